import { GaussianSplatElement } from '@gaussian-splat/element';
import { MemoryLedger } from '@gaussian-splat/renderer';
import { hasMemory } from '@gaussian-splat/renderer/tools';
import { DEFAULT_STEPS } from '@gaussian-splat/optimize/pages';
import { itInLab } from '../../support/extent-in-pages.js';
import { detailFolder } from '../../support/detail-folder.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { storedBlocks } from '../../support/stored-blocks.js';
import { assert, assertEqual, claimComing, devices, nextEvent, show, until } from './support/harness.js';

const folder = detailFolder(pebbles(40_000));

/**
 * Serves the folder: the manifest at its own address, pages at addresses that the worker can fetch as well; `lost` names missing pages. Records the page's requests to its loader, and its own fetches.
 */
async function serve(
  address: string,
  lost: RegExp = /$^/,
): Promise<{ requests: string[]; own: string[]; bytes: () => number; stop: () => void }> {
  const [requests, own]: string[][] = [[], []];
  let bytes = 0;
  const nameOf = new Map<string, string>();
  const locate = (name: string): string => {
    const url = lost.test(name)
      ? new URL(`/net/status/404?${name}`, location.href).href
      : URL.createObjectURL(new Blob([folder.files.get(name)!]));
    nameOf.set(url, name);
    return url;
  };
  const trees = folder.manifest.trees.map(({ pages }) => ({
    pages: pages.map((page) => ({ ...page, file: locate(page.file) })),
  }));
  await fetch(`${address}detail.json`, { method: 'PUT', body: JSON.stringify({ ...folder.manifest, trees }) });
  const [fetchOriginal, loader] = [window.fetch, GaussianSplatElement.sceneLoader];
  window.fetch = async (input, init) => {
    const url = new URL(input instanceof Request ? input.url : String(input), location.href);
    own.push(url.href);
    return fetchOriginal(input, init);
  };
  loader.fetchFile = async (request, signal) => {
    requests.push(nameOf.get(request.url)!);
    const file = await Object.getPrototypeOf(loader).fetchFile.call(loader, request, signal);
    bytes += file.byteLength;
    return file;
  };
  const stop = (): void => {
    window.fetch = fetchOriginal;
    Reflect.deleteProperty(loader, 'fetchFile');
    for (const url of nameOf.keys()) URL.revokeObjectURL(url);
  };
  return { requests, own, bytes: () => bytes, stop };
}

/** An element that is removed keeps its scene for a moment, in case it is put elsewhere; one without a source lets go of it, and of its fetches. */
async function close(element: GaussianSplatElement): Promise<void> {
  element.removeAttribute('src');
  await until(() => !element.loaded, 'the scene is let go');
  element.remove();
}

describe('a streamed scene', () => {
  itInLab('asks for its files with the query of its manifest', async () => {
    const loader = GaussianSplatElement.sceneLoader;
    const asked: string[] = [];
    await fetch('/net/kept/signed/detail.json', { method: 'PUT', body: JSON.stringify(folder.manifest) });
    loader.fetchFile = async ({ url }) => {
      const { pathname, search } = new URL(url);
      asked.push(search);
      return folder.files.get(pathname.replace('/net/kept/signed/', ''))!.slice(0);
    };
    try {
      const element = show({ src: '/net/kept/signed/detail.json?token=a' });
      await element.ready;
      assert(element.loaded, `loaded: ${element.error?.message}`);
      assert(asked.length > 0 && asked.every((search) => search === '?token=a'), asked.join());
      await close(element);
    } finally {
      Reflect.deleteProperty(loader, 'fetchFile');
    }
  });

  it('loads its coarsest page, shows it, and then fetches what the camera asks for, once each', async () => {
    const { requests, own, bytes, stop } = await serve('/net/kept/streamed/');
    const element = show({ src: '/net/kept/streamed/detail.json', 'camera-orbit': '30deg 60deg 30m' });
    await element.ready;
    assert(element.loaded && element.error === null, `loaded: ${element.error?.message}`);
    assertEqual(requests[0], 'pages/scene-00000.bin');
    const few = requests.length;
    element.setAttribute('camera-orbit', '200deg 80deg 1m');
    await until(() => requests.length > few + 3, 'pages for another view');
    assertEqual(new Set(requests).size, requests.length, 'no page twice');
    const all = (): number => requests.reduce((sum, name) => sum + folder.files.get(name)!.byteLength, 0);
    await until(() => bytes() === all(), 'all of them');
    assertEqual(own, [], 'what the page itself fetches');
    const { left, top } = element.getBoundingClientRect();
    const pick = (): Promise<unknown> => element.positionFromPoint(left + 60, top + 50);
    assert((await pick()) !== null, 'something in the middle');
    const cut = document.createElement('splat-cut');
    cut.setAttribute('scale', '1000');
    element.append(cut);
    let found: unknown = true;
    await until(() => {
      void pick().then((point) => (found = point));
      return found === null;
    }, 'a cut that hides all of its pages');
    await close(element);
    stop();
  });

  itInLab('as a child asks for what the view needs of it where it stands', async () => {
    const { requests, stop } = await serve('/net/kept/child/');
    const element = show({ 'camera-orbit': '200deg 80deg 30m', 'camera-target': '5 0 0', loading: 'eager' });
    const child = document.createElement('splat-scene');
    child.setAttribute('src', '/net/kept/child/detail.json');
    child.setAttribute('position', '5 0 0');
    element.append(child);
    await element.ready;
    assert(element.loaded, `loaded: ${element.stats?.scenes[0]?.error?.message}`);
    const few = requests.length;
    // Close to the scene itself. At its position without the placement no more pages are requested.
    element.setAttribute('camera-orbit', '200deg 80deg 1m');
    await until(() => requests.length > few + 3, 'pages for a closer view');
    assertEqual(new Set(requests).size, requests.length, 'no page twice');
    child.removeAttribute('src');
    await until(() => !(child as HTMLElement & { loaded: boolean }).loaded, 'the scene is let go');
    element.remove();
    stop();
  });

  it('comes from coded pages, which its worker decodes', async () => {
    const [loader, asked] = [GaussianSplatElement.sceneLoader, [] as boolean[]];
    const coded = detailFolder(pebbles(6_000), undefined, {
      geometry: 'quantized',
      coded: { steps: DEFAULT_STEPS, deflate: storedBlocks },
    });
    const address = '/net/kept/coded/';
    const put = (path: string, body: BodyInit): Promise<unknown> => fetch(address + path, { method: 'PUT', body });
    await Promise.all([...coded.files].map(([path, bytes]) => put(path, bytes)));
    await put('detail.json', JSON.stringify(coded.manifest));
    loader.fetchFile = (request, signal) => {
      asked.push(request.coded !== undefined);
      return Object.getPrototypeOf(loader).fetchFile.call(loader, request, signal) as Promise<ArrayBuffer>;
    };
    const view = { 'camera-orbit': '30deg 60deg 12m', 'camera-target': '0m 0m 0m' };
    try {
      const element = show({ src: `${address}detail.json`, detail: '0.02px', ...view });
      await element.ready;
      assert(element.loaded, `loaded: ${element.error?.message}`);
      await until(() => asked.length === coded.files.size, 'all files');
      assert(asked.every(Boolean), 'files that the worker decodes');
      await close(element);
      await put(coded.manifest.trees[0].pages[0].file, 'no page');
      const broken = show({ src: `${address}detail.json` });
      await broken.ready;
      assertEqual(broken.error?.reason, 'decode/corrupt');
      broken.remove();
    } finally {
      Reflect.deleteProperty(loader, 'fetchFile');
    }
  });

  itInLab('has less memory and coarser levels on a device that refuses more', async () => {
    claimComing(/too little memory for .* of pages/);
    const { stop } = await serve('/net/kept/little/');
    const { createBuffer } = GPUDevice.prototype;
    // Beside a large buffer of pages the device must also allocate 200 GB.
    const pools: number[] = [];
    GPUDevice.prototype.createBuffer = function (descriptor) {
      const isPool = descriptor.label === 'gs.pool.geometry';
      if (isPool) pools.push(descriptor.size);
      if (isPool && descriptor.size > pools[0] / 3)
        this.createTexture({ size: [8192, 8192, 200], format: 'rgba32float', usage: GPUTextureUsage.COPY_DST });
      return createBuffer.call(this, descriptor);
    };
    const element = show({ src: '/net/kept/little/detail.json', 'camera-orbit': '200deg 80deg 1m' });
    await element.ready;
    GPUDevice.prototype.createBuffer = createBuffer;
    assert(element.loaded && element.error === null, `loaded: ${element.error?.message}`);
    assert(pools.length > 2 && pools.at(-1)! <= pools[0] / 3, `pools of ${pools.join(' ')} bytes`);
    await until(() => element.stats!.streamed[0].limit === 'memory', 'pages in all of the memory');
    const { warnings, reasons } = element.stats!;
    assert(
      /too little memory/.test(warnings.join()) && /is full/.test(reasons.join()),
      [...warnings, ...reasons].join(),
    );
    await close(element);
    stop();
  });

  itInLab('comes back with half of the memory, and fewer splats, if its allocation loses the device', async () => {
    const { stop } = await serve('/net/kept/greedy/');
    GaussianSplatElement.memoryBudget = 2e6;
    const { createBuffer } = GPUDevice.prototype;
    const pools: number[] = [];
    GPUDevice.prototype.createBuffer = function (descriptor) {
      const buffer = createBuffer.call(this, descriptor);
      if (descriptor.label !== 'gs.pool.geometry') return buffer;
      pools.push(descriptor.size);
      if (descriptor.size > 0.7 * pools[0]) this.destroy();
      return buffer;
    };
    const element = show({ src: '/net/kept/greedy/detail.json', 'camera-orbit': '200deg 80deg 1m' });
    await element.ready;
    assert(element.loaded && element.error === null, `loaded: ${element.error?.message}`);
    assert(pools.length === 2 && pools[1] <= 0.7 * pools[0], `pools of ${pools.join(' ')} bytes`);
    await until(() => element.stats!.streamed[0].limit === 'memory', 'pages in all of the memory');
    assert(/is full/.test(element.stats!.reasons.join()), element.stats!.reasons.join());
    // A later loss begins with all of the memory, which loses the device again.
    const restored = nextEvent(element, 'contextrestored');
    const device = devices[devices.length - 1];
    const asked = hasMemory(device, 1e6);
    device.destroy();
    assertEqual(await asked, false, 'memory of a device that was lost meanwhile');
    await restored;
    GPUDevice.prototype.createBuffer = createBuffer;
    assertEqual(pools.slice(2).join(' '), pools.slice(0, 2).join(' '), 'pools');
    await close(element);
    GaussianSplatElement.memoryBudget = null;
    stop();
  });

  it('stays visible if a page is missing, and fails with a name if the first is', async () => {
    const warned: string[] = [];
    const original = console.warn;
    console.warn = (message: unknown) => void warned.push(String(message));
    const some = await serve('/net/kept/gaps/', /scene-0000[1-9]/);
    const element = show({ src: '/net/kept/gaps/detail.json', 'camera-orbit': '30deg 60deg 2m' });
    await element.ready;
    await until(() => warned.some((message) => message.includes('404')), 'a word on the missing page');
    assert(element.loaded && element.error === null, 'still visible');
    await close(element);
    some.stop();
    console.warn = original;
    const none = await serve('/net/kept/none/', /scene-00000/);
    const broken = show({ src: '/net/kept/none/detail.json' });
    await broken.ready;
    assertEqual(broken.error?.reason, 'network/status');
    broken.remove();
    none.stop();
  });

  itInLab(
    'comes back after a lost device, while pages were coming, within the pixels that it was to be drawn within',
    async () => {
      const { requests, stop } = await serve('/net/kept/lost/');
      const element = show({ src: '/net/kept/lost/detail.json', 'camera-orbit': '30deg 60deg 3m', detail: '0.3px' });
      await element.ready;
      assertEqual(element.stats?.detail.pixels, 0.3, 'pixels');
      for (let loss = 0; loss < 2; loss++) {
        await until(() => requests.filter((name) => name !== 'pages/scene-00000.bin').length > 0, 'pages on their way');
        const restored = nextEvent(element, 'contextrestored');
        requests.length = 0;
        devices[devices.length - 1].destroy();
        await restored;
        await until(() => element.stats?.detail.pixels === 0.3, 'as much detail as before');
      }
      await until(
        () => requests.filter((name) => name !== 'pages/scene-00000.bin').length > 0,
        'pages of the new device',
      );
      assertEqual(new Set(requests).size, requests.length, 'no page twice');
      await close(element);
      assertEqual(MemoryLedger.of(devices[devices.length - 1]).bytes, 0, 'bytes held');
      stop();
    },
  );

  itInLab("'is loaded on the main thread if workers are refused'", async () => {
    const original = GaussianSplatElement.sceneLoader;
    const Loader = original.constructor as new (spawn: () => Worker) => typeof original;
    GaussianSplatElement.sceneLoader = new Loader(() => new Worker('/net/status/404', { type: 'module' }));
    const { requests, own, bytes, stop } = await serve('/net/kept/refused/');
    const element = show({ src: '/net/kept/refused/detail.json', 'camera-orbit': '200deg 80deg 1m' });
    await element.ready;
    await until(() => own.length > 3 && bytes() > 0, 'pages that the page itself fetches');
    assert(requests.length >= own.length - 1, 'all of them asked of the loader');
    await close(element);
    stop();
    GaussianSplatElement.sceneLoader = original;
    await claimComing(/console\.warn: <gaussian-splat>: no worker could be started .*workerLocation/);
  });

  itInLab('beside others makes do with less memory, and has a place', async () => {
    const { stop } = await serve('/net/kept/beside/');
    const src = '/net/kept/beside/detail.json';
    const first = show({ src, 'camera-orbit': '200deg 80deg 1m' });
    await first.ready;
    const ledger = MemoryLedger.of(devices[devices.length - 1]);
    const one = ledger.bytes;
    Object.defineProperty(navigator, 'deviceMemory', { configurable: true, value: (2.2 * one) / 2 ** 29 });
    try {
      const others = Array.from({ length: 3 }, () => show({ src, 'camera-orbit': '200deg 80deg 1m' }));
      for (const element of others) {
        await element.ready;
        assert(element.loaded, String(element.error?.message));
      }
      assert(ledger.bytes > one && ledger.bytes <= ledger.budgetBytes, `${ledger.bytes} of ${ledger.budgetBytes}`);
      for (const element of [first, ...others]) await close(element);
    } finally {
      delete (navigator as { deviceMemory?: number }).deviceMemory;
      stop();
    }
  });
});
