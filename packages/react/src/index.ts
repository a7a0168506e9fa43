'use client';
/** `<gaussian-splat>` for React 18 and 19. */
import '@gaussian-splat/element';
import { GaussianSplatElement, type SettableProperties } from '@gaussian-splat/element';
import { createComponent } from '@lit/react';
import * as React from 'react';
import { HANDLERS, type Listeners } from './events.js';

export type { HandlerName, Handlers, Listeners } from './events.js';
export type { GaussianSplatElement } from '@gaussian-splat/element';

/**
 * Props of {@link GaussianSplat}: the element's properties, handlers of its events, React's common attributes, and
 * `ref`.
 */
export type GaussianSplatProps = Omit<
  React.HTMLAttributes<GaussianSplatElement>,
  keyof Listeners | keyof SettableProperties
> &
  Listeners &
  SettableProperties &
  React.RefAttributes<GaussianSplatElement>;

/**
 * The element as a component: its properties by reference, its events as handlers, its element by `ref`.
 *
 * ```tsx
 * <GaussianSplat src="scene.ply" alt="A skull" cameraControls onLoad={({ detail }) => console.log(detail.url)} />
 * ```
 */
export const GaussianSplat: React.ForwardRefExoticComponent<GaussianSplatProps> = createComponent({
  react: React,
  tagName: 'gaussian-splat',
  elementClass: GaussianSplatElement,
  events: HANDLERS,
  displayName: 'GaussianSplat',
});

export {
  SplatMesh,
  SplatScene,
  type SplatMeshElement,
  type SplatMeshProps,
  type SplatSceneElement,
  type SplatSceneProps,
} from './scenes.js';
