/**
 * Types of the bare tags `<gaussian-splat>`, `<splat-scene>`, `<splat-mesh>` and `<splat-cut>` in JSX: `import type {}
 * from '@gaussian-splat/react/jsx'`. React sets properties; of the events only those with lower-case handlers work
 * (`onload`, `oncamera-change`), so only these names are declared.
 */
import type { GaussianSplatElement, GaussianSplatEventMap, SettableProperties } from '@gaussian-splat/element';
import type * as React from 'react';
import type {
  ChildEventMap,
  SettableCutProperties,
  SettableMeshProperties,
  SettableSceneProperties,
  SplatCutElement,
  SplatMeshElement,
  SplatSceneElement,
} from '@gaussian-splat/element/scenes.js';
import type { HandlerName } from './events.js';

type SmallListeners<Events> = {
  [Type in keyof Events & string as `on${Type}`]?: (event: Events[Type]) => void;
};

type Props<E, Settable, Events = ChildEventMap> = Omit<
  React.DetailedHTMLProps<React.HTMLAttributes<E>, E>,
  HandlerName | keyof Settable
> &
  Settable &
  SmallListeners<Events>;

declare module 'react' {
  // Extending React's own namespace is the way to declare a tag.
  // eslint-disable-next-line @typescript-eslint/no-namespace
  namespace JSX {
    interface IntrinsicElements {
      'gaussian-splat': Props<GaussianSplatElement, SettableProperties, GaussianSplatEventMap>;
      'splat-scene': Props<SplatSceneElement, SettableSceneProperties>;
      'splat-mesh': Props<SplatMeshElement, SettableMeshProperties>;
      'splat-cut': Props<SplatCutElement, SettableCutProperties, object>;
    }
  }
}
