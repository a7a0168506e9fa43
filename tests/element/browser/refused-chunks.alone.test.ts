/** Every chunk of the CDN build is refused once, by its address. A second request succeeds, and no error stays uncaught. */
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { detailFolder } from '../../support/detail-folder.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { boxGlb } from './support/glb.js';
import { assert, assertEqual, COMPASS, delay, show, until } from './support/harness.js';

const CDN = '/packages/element/cdn/';
/** One pixel. */
const SKY =
  'data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==';
const GENERATORS = '/tests/fixtures/generators/';

/** Chunks that this page cannot ask for, and why. */
const NOT_ASKED: Readonly<Record<string, string>> = {
  'no-device': 'errors of browsers without WebGPU: tests/element/browser/device.test.ts',
  'device-recovery': 'no device comes back: tests/stability/browser',
  search: 'depends on what an earlier visit has kept',
  refusal: 'a page that refuses workers: tests/element/browser/cdn.test.ts',
  'detail-budget': 'streamed scenes that exceed their budget of splats',
  'decode-page': 'coded pages are decoded by the worker',
  'start-helpers': 'PLY files of 32 MB',
  'part-uploads': 'PLY files that are uploaded in parts',
  'preview-uploads': 'previews of files that arrive slowly',
  'file-request': 'shared by chunks that are asked for',
  'few-tiles': 'kernels that software adapters never load',
};

const uncaught: string[] = [];
window.addEventListener('error', ({ message }) => uncaught.push(message));
window.addEventListener('unhandledrejection', ({ reason }) => uncaught.push(String(reason)));

/** Chunks that were refused, and how often each was served afterwards. */
const answers = async (): Promise<Record<string, number>> =>
  (await (await fetch('/net/refused')).json()) as Record<string, number>;

/** Does something until it works: each chunk that it needs fails once. */
async function again(what: string, act: () => Promise<unknown>): Promise<void> {
  for (let tries = 1; ; tries++) {
    try {
      return void (await act());
    } catch (error) {
      if (tries === 12) throw new Error(`${what}: ${(error as Error).message}`, { cause: error });
      await delay(50);
    }
  }
}

/** Loads the sources of an element until no code is missing any more. Other errors do not count. */
const load = (element: GaussianSplatElement, isWrong = false): Promise<void> =>
  again(String(element.src), async () => {
    await element.ready;
    const { error } = element;
    if (error === null || (isWrong && !error.reason.startsWith('network/'))) return;
    element.load();
    throw new Error(error.message);
  });

/** Triggers that request a chunk at most every five seconds after a failure, on updates or frames. */
const eventually = (what: string, isThere: () => boolean, poke: () => void): Promise<void> =>
  until(
    () => {
      if (!isThere()) poke();
      return isThere();
    },
    what,
    40_000,
  );

/** Waits until a chunk that was refused has been served: for code whose effects the test does not observe. */
async function comes(chunk: string, poke: () => void): Promise<void> {
  const end = performance.now() + 40_000;
  const isChunk = new RegExp(`^${chunk}-[\\w-]{8}\\.js$`);
  for (;;) {
    if (Object.entries(await answers()).some(([name, times]) => isChunk.test(name) && times > 0)) return;
    assert(performance.now() < end, `${chunk} comes`);
    poke();
    await delay(250);
  }
}

const file = (name: string, ...parts: BlobPart[]): File => new File(parts, name);
const json = (value: object): string => JSON.stringify(value);

describe('chunks that are refused once', () => {
  // The console reports missing code, and a file without groups, which are no faults here.
  const { warn } = console;
  before(() => {
    console.warn = (...words: unknown[]) => {
      if (!/expected a module that can be loaded|one of the properties object_id/.test(words.join(' '))) warn(...words);
    };
  });
  after(() => {
    console.warn = warn;
  });

  itInLab('come when they are asked for again, each of the build', async () => {
    await fetch(`/net/refuse-once${CDN}`);
    await import(`${CDN}gaussian-splat.min.js`);
    const element = show({ src: COMPASS.replace('.splat', '.ply') }, 'width: 64px; height: 48px');
    const part = (name: string): Element | null => element.shadowRoot!.querySelector(`[part=${name}]`);
    await load(element);

    // Methods: a second call succeeds.
    await again('flyTo', () => element.flyTo({ orbit: '10deg 75deg 5m' }, { duration: 0 }));
    await again('toBlob', () => element.toBlob());
    await again('positionFromPoint', () => element.positionFromPoint(20, 20));
    await again('updateStats', () => element.updateStats());

    // Attributes: asked for again by later updates.
    const update = (): void => element.requestUpdate();
    const turn = (): void => void (element.cameraOrbit = `${Math.round(performance.now())}deg 75deg 5m`);
    element.cameraControls = true;
    await eventually('the help for the keyboard', () => element.shadowRoot!.querySelector('#keys') !== null, update);
    element.setAttribute('navigation', 'fly');
    element.autoRotate = true;
    element.autoRotateDelay = 0;
    const before = String(element.getCameraOrbit());
    await eventually('turning', () => String(element.getCameraOrbit()) !== before, update);
    element.autoRotate = false;
    const label = document.createElement('button');
    label.slot = 'hotspot-a';
    label.dataset.position = '0m 0m 0m';
    element.append(label);
    await eventually(
      'labels',
      () => element.queryHotspot('hotspot-a') !== null,
      () => label.toggleAttribute('data-orbit'),
    );
    element.setAttribute('detail', '1px');
    await eventually('levels of detail', () => element.stats?.detail.pixels === 1, update);
    element.setAttribute('order', 'pixel');
    for (let i = 0; i < 10; i++) {
      turn();
      await delay(50);
    }

    // Sources: load() tries again.
    const shown = async (
      attributes: Record<string, string>,
      properties: Partial<GaussianSplatElement> = {},
      isWrong?: boolean,
    ): Promise<void> => {
      const other = Object.assign(show(attributes, 'width: 32px; height: 24px'), properties);
      await load(other, isWrong);
      other.remove();
    };
    await shown({ src: COMPASS });
    await shown({ src: COMPASS, renderer: 'webgl' });
    for (const renderer of ['webgpu', 'webgl']) await shown({ renderer }, { splats: pebbles(20) });
    await shown({ src: '/net/sequence/movie.json' });
    const model = show({ src: `${GENERATORS}state.onnx`, 'controls-panel': '' }, 'width: 32px; height: 24px');
    await load(model);
    await comes('controls-panel', () => model.setAttribute('controls-panel', ''));
    model.setAttribute('postprocess', `${GENERATORS}post.onnx`);
    await comes('post-controller', () => {
      model.removeAttribute('postprocess');
      void model.updateComplete.then(() => model.setAttribute('postprocess', `${GENERATORS}post.onnx`));
    });
    model.remove();
    const clip = show({ src: '/net/clip/ball.gsv' }, 'width: 32px; height: 24px');
    await load(clip);
    const audio = document.createElement('audio');
    audio.slot = 'sound';
    clip.append(audio);
    await comes('sound', () => audio.toggleAttribute('data-orbit'));
    clip.remove();
    const folder = detailFolder(pebbles(2_000));
    for (const [name, bytes] of folder.files) await fetch(`/net/kept/chunks/${name}`, { method: 'PUT', body: bytes });
    await fetch('/net/kept/chunks/detail.json', { method: 'PUT', body: json(folder.manifest) });
    await shown({ src: '/net/kept/chunks/detail.json' });
    for (const wrong of [
      file(
        'a.ply',
        'ply\nformat binary_little_endian 1.0\nelement chunk 1\nproperty float packed_position\nend_header\n',
      ),
      file('a.spz', 'NGSP', new Uint8Array(60)),
      file('a.spz', new Uint8Array([0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 0])),
      file('a.zip', 'PK\x03\x04', new Uint8Array(60)),
      file('meta.json', json({ means: {} })),
      file('lod-meta.json', json({ lodLevels: 1, filenames: [] })),
      file('a.glb', 'glTF', new Uint8Array(60)),
      file('a.ksplat', new Uint8Array(8192)),
      file('a.html', '<!doctype html>'),
    ])
      await shown({}, { src: wrong }, true);

    // Children, and three.js for meshes.
    const room = show({}, 'width: 32px; height: 24px');
    const child = document.createElement('splat-scene');
    child.setAttribute('src', COMPASS);
    room.append(child);
    const mesh = document.createElement('splat-mesh');
    room.append(mesh);
    await eventually(
      'children',
      () => 'load' in mesh,
      () => child.toggleAttribute('data-orbit'),
    );
    mesh.src = boxGlb();
    await until(
      () => {
        if (!mesh.loaded && 'error' in mesh && mesh.error) mesh.load();
        return mesh.loaded;
      },
      'a mesh',
      40_000,
    );

    child.setAttribute('interactive', '');
    await comes('interaction', () => child.toggleAttribute('interactive'));

    // Features that few pages use, by attributes and a child.
    for (const name of ['measure', 'vr', 'ar']) element.setAttribute(name, '');
    element.setAttribute('shadow-intensity', '1');
    const cut = document.createElement('splat-cut');
    element.append(cut);
    await comes('effects', () => cut.toggleAttribute('data-orbit'));
    element.setAttribute('groups', '');
    await comes('groups', update);
    await load(element);
    element.setAttribute('attribution', 'Ann');
    await comes('credit-line', update);
    await again('toBlob with credits', () => element.toBlob());
    await again('renderDepth', () => element.renderDepth({ width: 8 }));
    label.dataset.door = COMPASS;
    element.setAttribute('floor-plan', '');
    for (const name of ['doors', 'floor-plan']) await comes(name, () => label.toggleAttribute('data-orbit'));
    for (const name of ['offers', 'measure', 'xr-offer', 'vr', 'ar', 'shadow-controller', 'take-alpha'])
      await comes(name, update);
    const flat = show({ src: COMPASS, renderer: 'webgl', 'shadow-intensity': '1' }, 'width: 32px; height: 24px');
    await load(flat);
    await comes('gl-shadow', () => flat.requestUpdate());
    flat.remove();
    element.setAttribute('navigation', 'walk');
    await comes('walk-controller', update);
    element.setAttribute('skybox-image', SKY);
    await comes('sky', update);
    // Another language asks again.
    for (const lang of ['de', 'es', 'fr', 'ja', 'ko', 'pt', 'ru', 'zh'])
      await comes(`words-${lang}`, () => {
        element.lang = element.lang === lang ? 'en' : lang;
        update();
      });

    // Frames in motion: their quality is asked for by frames.
    await eventually('the quality while moving', () => element.stats!.dynamicQuality.lastMs !== null, turn);
    assert(part('canvas') !== null, 'the canvas');

    const chunks = Object.keys((await (await fetch(`${CDN}integrity.json`)).json()) as object).filter((name) =>
      /^[^/]+-[\w-]{8}\.js$/.test(name),
    );
    const served = await answers();
    const missed = chunks.filter((name) => !served[name]).map((name) => name.replace(/-[\w-]{8}\.js$/, ''));
    assertEqual(
      missed.filter((name) => !(name in NOT_ASKED)),
      [],
      `chunks not there; served: ${Object.keys(served).join(' ')}`,
    );
    assertEqual(uncaught, [], 'uncaught errors');
  }).timeout(400_000);
});
