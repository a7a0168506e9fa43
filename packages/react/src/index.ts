'use client';
/** The component for `<gaussian-splat>` in React 18 and 19. */
import '@gaussian-splat/element';
import { GaussianSplatElement, type SettableProperties } from '@gaussian-splat/element';
import { createComponent } from '@lit/react';
import * as React from 'react';
import { assignedOnChange } from './assigned-on-change.js';
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
 * Component for `<gaussian-splat>`. Props set properties of the element without conversion, handlers listen to its
 * events, and `ref` receives the element. A prop that does not change leaves the camera and the clock where they are.
 *
 * ```tsx
 * <GaussianSplat src="scene.ply" alt="A skull" cameraControls onLoad={({ detail }) => console.log(detail.url)} />
 * ```
 */
export const GaussianSplat: React.ForwardRefExoticComponent<GaussianSplatProps> = assignedOnChange<
  GaussianSplatElement,
  GaussianSplatProps
>(
  createComponent({
    react: React,
    tagName: 'gaussian-splat',
    elementClass: GaussianSplatElement,
    events: HANDLERS,
    displayName: 'GaussianSplat',
  }),
  ['cameraOrbit', 'cameraTarget', 'fieldOfView', 'currentTime', 'src', 'walkMap'],
);

export {
  SplatCut,
  SplatMesh,
  SplatScene,
  type SplatCutElement,
  type SplatCutProps,
  type SplatMeshElement,
  type SplatMeshProps,
  type SplatSceneElement,
  type SplatSceneProps,
} from './scenes.js';
