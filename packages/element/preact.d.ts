/**
 * Types of `<gaussian-splat>`, `<splat-scene>`, `<splat-mesh>` and `<splat-cut>` in Preact's JSX: `import type {} from
 * '@gaussian-splat/element/preact'`. Props are properties, such as `cameraControls`, or attributes with a hyphen.
 * Listeners have the name of the event: `onload`, `oncamera-change`.
 */
import type { HTMLAttributes } from 'preact';
import type { GaussianSplatElement, GaussianSplatEventMap, SettableProperties } from './dist/index.js';
import type {
  ChildEventMap,
  SettableCutProperties,
  SettableMeshProperties,
  SettableSceneProperties,
  SplatCutElement,
  SplatMeshElement,
  SplatSceneElement,
} from './dist/scenes.js';

/** Listeners, also in the usual spelling `onLoad` for names of one word. */
type Listeners<Events> = {
  [Type in string & keyof Events as `on${Type}` | `on${Capitalize<Type>}`]?: (event: Events[Type]) => void;
};

type Tag<E extends HTMLElement, Settable, Events = object> = Omit<
  HTMLAttributes<E>,
  keyof Settable | keyof Listeners<Events>
> &
  Settable &
  Listeners<Events>;

declare module 'preact' {
  namespace JSX {
    interface IntrinsicElements {
      'gaussian-splat': Tag<GaussianSplatElement, SettableProperties, GaussianSplatEventMap>;
      'splat-scene': Tag<SplatSceneElement, SettableSceneProperties, ChildEventMap>;
      'splat-mesh': Tag<SplatMeshElement, SettableMeshProperties, ChildEventMap>;
      'splat-cut': Tag<SplatCutElement, SettableCutProperties>;
    }
  }
}
