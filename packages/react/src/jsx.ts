/**
 * Types of the bare tag `<gaussian-splat>` in JSX: `import type {} from '@gaussian-splat/react/jsx'`. React sets its properties; of its
 * events only those with handlers in small letters arrive (`onload`, `oncamera-change`), so that no other name is taken.
 */
import type { GaussianSplatElement, GaussianSplatEventMap, SettableProperties } from '@gaussian-splat/element';
import type * as React from 'react';
import type { HandlerName } from './events.js';

type SmallListeners = {
  [Type in keyof GaussianSplatEventMap as `on${Type}`]?: (event: GaussianSplatEventMap[Type]) => void;
};

type Props = Omit<
  React.DetailedHTMLProps<React.HTMLAttributes<GaussianSplatElement>, GaussianSplatElement>,
  HandlerName | keyof SettableProperties
> &
  SettableProperties &
  SmallListeners;

declare module 'react' {
  // The way to tell React of a tag is to add it to its own namespace.
  // eslint-disable-next-line @typescript-eslint/no-namespace
  namespace JSX {
    interface IntrinsicElements {
      'gaussian-splat': Props;
    }
  }
}
