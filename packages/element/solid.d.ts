/**
 * Types of `<gaussian-splat>`, `<splat-scene>`, `<splat-mesh>` and `<splat-cut>` in Solid's JSX: `import type {} from
 * '@gaussian-splat/element/solid'`. Attributes have their names in HTML; `prop:cameraControls={true}` sets a property,
 * and `on:camera-change` listens to an event.
 */
import type { JSX } from 'solid-js';
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

type Listeners<Events> = { [Type in string & keyof Events as `on:${Type}`]?: (event: Events[Type]) => void };

/** Solid sets props of custom elements as properties if they have `prop:`, and as attributes otherwise. */
type Tag<E extends HTMLElement, Settable, Events = object> = Omit<
  JSX.HTMLAttributes<E>,
  keyof Settable | keyof Listeners<Events>
> & { [Name in string & keyof Settable as `prop:${Name}`]?: Settable[Name] } & {
  [Name in string & keyof Settable as Lowercase<Name>]?: string | boolean | undefined;
} & Listeners<Events>;

declare module 'solid-js' {
  namespace JSX {
    interface IntrinsicElements {
      'gaussian-splat': Tag<GaussianSplatElement, SettableProperties, GaussianSplatEventMap>;
      'splat-scene': Tag<SplatSceneElement, SettableSceneProperties, ChildEventMap>;
      'splat-mesh': Tag<SplatMeshElement, SettableMeshProperties, ChildEventMap>;
      'splat-cut': Tag<SplatCutElement, SettableCutProperties>;
    }
  }
}
