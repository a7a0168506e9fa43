/** Actions of renderers on the element that authors do not take: markup from a server with a shadow root in it, a new object for every render. */
import '@gaussian-splat/element';
import { assert, assertEqual, COMPASS, frames, showLoaded } from '../../element/browser/support/harness.js';
import type { GaussianSplatElement } from '@gaussian-splat/element';

describe('an element that something else renders', () => {
  it('takes over the declarative shadow root of a server', async () => {
    const place = document.createElement('div');
    place.setHTMLUnsafe(`<gaussian-splat src="${COMPASS}" alt="A compass" loading="eager">
      <template shadowrootmode="open"><div id="view"><canvas></canvas><p role="status">From the server</p></div></template></gaussian-splat>`);
    const element = place.firstElementChild as GaussianSplatElement;
    const root = element.shadowRoot!;
    assert(root.textContent?.includes('From the server'), 'the parser made a shadow root');
    document.body.append(place);
    await element.ready;
    assert(element.loaded, element.error?.message ?? 'not loaded');
    const count = (selector: string): number => element.shadowRoot!.querySelectorAll(selector).length;
    assertEqual([count('#view'), count('canvas')], [1, 1], 'views and canvases');
    assert(
      element.shadowRoot === root && !root.textContent?.includes('From the server'),
      'one root, of our own content',
    );
  });

  it('loads again for another contract, and not for an equal object', async () => {
    const element = await showLoaded();
    let starts = 0;
    element.addEventListener('loadstart', () => starts++);
    const render = async (contract: object | null | undefined): Promise<number> => {
      Object.assign(element, { contract });
      await element.updateComplete;
      await element.ready;
      await frames();
      return starts;
    };
    assertEqual(await render(undefined), 0, 'no contract either way');
    assertEqual(await render({ version: 1, duration: 2 }), 1, 'a contract');
    assertEqual(await render({ version: 1, duration: 2 }), 1, 'the same again');
    assertEqual(await render({ version: 1, duration: 3 }), 2, 'another one');
    // A scene with a contract is read as a generator. This file is none, and the test counts its requests.
    assertEqual(element.error?.code, 'decode', 'error');
  });
});

describe('children that a server has written', () => {
  it('are shown, whether the tags are defined before or after they are parsed', async () => {
    for (let i = 0; i < 2; i++) {
      const place = document.createElement('div');
      place.setHTMLUnsafe(`<gaussian-splat alt="Two scenes" loading="eager" style="display: block; width: 60px; height: 50px">
        <template shadowrootmode="open"><p>From the server</p></template>
        <splat-scene src="${COMPASS}" position="-2 0 0"></splat-scene>
        <splat-scene src="${COMPASS}" position="2 0 0"></splat-scene></gaussian-splat>`);
      document.body.append(place);
      const element = place.firstElementChild as GaussianSplatElement;
      await element.ready;
      assertEqual(
        element.stats?.scenes.map(({ state }) => state),
        ['ready', 'ready'],
        'children',
      );
    }
  });
});
