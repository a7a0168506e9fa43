/** The same in Vue. */
import '@gaussian-splat/element/scenes.js';
import { createApp, h, nextTick, shallowRef } from 'vue';
import type { Child, Rendering } from './scenes.js';

export { GaussianSplatElement } from '@gaussian-splat/element';

export function mount(place: HTMLElement, attributes: object, report: (name: string, what: string) => void): Rendering {
  const children = shallowRef<readonly Child[]>([]);
  const app = createApp(() =>
    h(
      'gaussian-splat',
      attributes,
      children.value.map(({ name, kind, ...properties }) =>
        h(kind === 'mesh' ? 'splat-mesh' : 'splat-scene', {
          ...{ key: name, id: name, ...properties },
          onLoad: () => report(name, 'load'),
          onError: ({ detail }: CustomEvent<{ code: string; reason: string; message: string }>) =>
            report(name, detail.code === 'network' ? detail.reason : detail.message),
        }),
      ),
    ),
  );
  app.mount(place);
  return {
    render: (next) => {
      children.value = next;
      return nextTick();
    },
    unmount: () => app.unmount(),
  };
}
