'use client';
/** `<gaussian-splat>` for React 18 and 19. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { createComponent } from '@lit/react';
import * as React from 'react';
import { HANDLERS } from './events.js';

export type { Handlers } from './events.js';
export type { GaussianSplatElement } from '@gaussian-splat/element';

/**
 * The element as a component: its properties by reference, its events as handlers, its element by `ref`.
 *
 * ```tsx
 * <GaussianSplat src="scene.ply" alt="A skull" cameraControls onLoad={({ detail }) => console.log(detail.url)} />
 * ```
 */
export const GaussianSplat = createComponent({
  react: React,
  tagName: 'gaussian-splat',
  elementClass: GaussianSplatElement,
  events: HANDLERS,
  displayName: 'GaussianSplat',
});

/** What {@link GaussianSplat} takes. */
export type GaussianSplatProps = React.ComponentProps<typeof GaussianSplat>;
