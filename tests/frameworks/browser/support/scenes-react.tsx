/** Children of the element as React renders them, bundled by ../../../element/browser/support/apps.mjs. */
import { GaussianSplat, SplatMesh, SplatScene } from '@gaussian-splat/react';
import { createRoot } from 'react-dom/client';
import { flushSync } from 'react-dom';
import type { Child, Rendering } from './scenes.js';

export { GaussianSplatElement } from '@gaussian-splat/element';

export function mount(place: HTMLElement, attributes: object, report: (name: string, what: string) => void): Rendering {
  const root = createRoot(place);
  const childOf = ({ name, kind, ...properties }: Child) => {
    const Tag = kind === 'mesh' ? SplatMesh : SplatScene;
    return (
      <Tag
        key={name}
        id={name}
        {...properties}
        onLoad={() => report(name, 'load')}
        onError={({ detail }) => report(name, detail.code === 'network' ? detail.reason : detail.message)}
      />
    );
  };
  return {
    render: (children) =>
      flushSync(() => root.render(<GaussianSplat {...attributes}>{children.map(childOf)}</GaussianSplat>)),
    unmount: () => root.unmount(),
  };
}
