/**
 * Types of `<gaussian-splat>` in Vue's templates: `import type {} from '@gaussian-splat/element/vue'`. Nothing runs; tell Vue's compiler of the
 * tag with `isCustomElement: (tag) => tag === 'gaussian-splat'`.
 */
import type { HTMLAttributes, PublicProps } from 'vue';
import type { GaussianSplatElement } from './element.js';
import type { GaussianSplatEventMap } from './events.js';
import type { SettableProperties } from './media.js';

/** `camera-change` as Vue names its listeners: `onCameraChange`. */
type ListenerName<Type extends string> = Type extends `${infer Head}-${infer Tail}`
  ? `${Capitalize<Head>}${Capitalize<Tail>}`
  : Capitalize<Type>;
type Listeners = {
  [Type in string & keyof GaussianSplatEventMap as `on${ListenerName<Type>}`]?: (
    event: GaussianSplatEventMap[Type],
  ) => void;
};

/** What Vue looks at in a component, for a tag of the platform. */
type CustomElement = new () => GaussianSplatElement & {
  /** @deprecated Only for the types of templates. */
  readonly $props: Omit<HTMLAttributes, keyof Listeners> & Listeners & SettableProperties & PublicProps;
};

declare module 'vue' {
  interface GlobalComponents {
    'gaussian-splat': CustomElement;
  }
}
