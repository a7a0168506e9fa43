/**
 * Types of `<gaussian-splat>`, `<splat-scene>`, `<splat-mesh>` and `<splat-cut>` in Vue's templates: `import type {}
 * from '@gaussian-splat/element/vue'`. The module contains no code. Vue's compiler needs the option `isCustomElement:
 * (tag) => /^(gaussian-splat|splat-)/.test(tag)`.
 */
import type { HTMLAttributes, PublicProps } from 'vue';
import type { GaussianSplatElement } from './viewer/element.js';
import type { GaussianSplatEventMap } from './viewer/events.js';
import type { SettableProperties } from './viewer/media.js';
import type {
  ChildEventMap,
  SettableCutProperties,
  SettableMeshProperties,
  SettableSceneProperties,
  SplatCutElement,
  SplatMeshElement,
  SplatSceneElement,
} from './scenes.js';

/** Name of a listener in Vue without `on`: `CameraChange` for `camera-change`. */
type ListenerName<Type extends string> = Type extends `${infer Head}-${infer Tail}`
  ? `${Capitalize<Head>}${Capitalize<Tail>}`
  : Capitalize<Type>;
type Listeners<Events> = {
  [Type in string & keyof Events as `on${ListenerName<Type>}`]?: (event: Events[Type]) => void;
};

/** The component type that Vue expects for a native tag. */
type CustomElement<E, Settable, Events> = new () => E & {
  /** @deprecated Only for the types of templates. */
  readonly $props: Omit<HTMLAttributes, keyof Listeners<Events> | keyof Settable> &
    Listeners<Events> &
    Settable &
    PublicProps;
};

declare module 'vue' {
  interface GlobalComponents {
    'gaussian-splat': CustomElement<GaussianSplatElement, SettableProperties, GaussianSplatEventMap>;
    'splat-scene': CustomElement<SplatSceneElement, SettableSceneProperties, ChildEventMap>;
    'splat-mesh': CustomElement<SplatMeshElement, SettableMeshProperties, ChildEventMap>;
    'splat-cut': CustomElement<SplatCutElement, SettableCutProperties, object>;
  }
}
