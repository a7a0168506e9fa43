import type { GaussianSplatElement } from '@gaussian-splat/element';
import '@gaussian-splat/element';
import { detailFolder } from '../../support/detail-folder.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { assert, assertEqual, show, until } from './support/harness.js';

const folder = detailFolder(pebbles(40_000));

/** Serves the folder below an address of its own; `lost` names files that are not there. */
function serve(address: string, lost: RegExp = /$^/): { requests: string[]; stop: () => void } {
  const original = window.fetch;
  const requests: string[] = [];
  window.fetch = async (input, init) => {
    const { pathname } = new URL(input instanceof Request ? input.url : String(input), location.href);
    if (!pathname.startsWith(address)) return original(input, init);
    const name = pathname.slice(address.length);
    requests.push(name);
    if (lost.test(name)) return new Response('', { status: 404 });
    if (name === 'detail.json') return new Response(JSON.stringify(folder.manifest));
    return new Response(folder.files.get(name)!.slice(0));
  };
  return { requests, stop: () => (window.fetch = original) };
}

/** An element that is removed keeps its scene for a moment, in case it is put elsewhere; one without a source lets go of it, and of its fetches. */
async function close(element: GaussianSplatElement): Promise<void> {
  element.removeAttribute('src');
  await until(() => !element.loaded, 'the scene is let go');
  element.remove();
}

describe('a streamed scene', () => {
  it('loads its coarsest page, shows it, and then fetches what the camera asks for, once each', async () => {
    const { requests, stop } = serve('/streamed/');
    const element = show({ src: '/streamed/detail.json', 'camera-orbit': '30deg 60deg 30m' });
    await element.ready;
    assert(element.loaded && element.error === null, `loaded: ${element.error?.message}`);
    assertEqual(requests.slice(0, 2).join(' '), 'detail.json part-0');
    const few = requests.length;
    element.setAttribute('camera-orbit', '200deg 80deg 1m');
    await until(() => requests.length > few + 3, 'pages for another view');
    assertEqual(new Set(requests).size, requests.length, 'no page twice');
    await close(element);
    stop();
  });

  it('stays on show where a page is missing, and fails with a name where the first is', async () => {
    const warned: string[] = [];
    const original = console.warn;
    console.warn = (message: unknown) => void warned.push(String(message));
    const some = serve('/gaps/', /part-[1-9]/);
    const element = show({ src: '/gaps/detail.json', 'camera-orbit': '30deg 60deg 2m' });
    await element.ready;
    await until(() => warned.some((message) => message.includes('404')), 'a word on the missing page');
    assert(element.loaded && element.error === null, 'still on show');
    await close(element);
    some.stop();
    console.warn = original;
    const none = serve('/none/', /part-0/);
    const broken = show({ src: '/none/detail.json' });
    await broken.ready;
    assertEqual(broken.error?.reason, 'network/status');
    broken.remove();
    none.stop();
  });
});
