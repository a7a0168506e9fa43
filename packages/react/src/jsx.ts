/**
 * Types of the tags `<gaussian-splat>`, `<splat-scene>`, `<splat-mesh>` and `<splat-cut>` in JSX: `import type {} from
 * '@gaussian-splat/react/jsx'`. React sets properties, but of the events it supports only those with lower-case
 * handlers (`onload`, `oncamera-change`), so only these names are declared.
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
  // Tags are declared by extending React's own namespace.
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
