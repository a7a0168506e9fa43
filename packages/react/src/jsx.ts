/**
 * Types of the bare tag `<gaussian-splat>` in JSX: `import type {} from '@gaussian-splat/react/jsx'`. React sets its properties; of its
 * events only those with handlers in small letters arrive (`onload`, `oncamera-change`).
 */
import type { GaussianSplatElement, GaussianSplatEventMap } from '@gaussian-splat/element';
import type { WebComponentProps } from '@lit/react';

type Listeners = {
  [Type in keyof GaussianSplatEventMap as `on${Type}`]?: (event: GaussianSplatEventMap[Type]) => void;
};

declare module 'react' {
  // The way to tell React of a tag is to add it to its own namespace.
  // eslint-disable-next-line @typescript-eslint/no-namespace
  namespace JSX {
    interface IntrinsicElements {
      'gaussian-splat': Omit<WebComponentProps<GaussianSplatElement>, keyof Listeners> & Listeners;
    }
  }
}
