/** The element without WebGPU, or on a page that requests WebGL: the same scene, camera, events and questions. */
import '@gaussian-splat/element';
import type { SplatMeshElement, SplatSceneElement } from '@gaussian-splat/element/scenes.js';
import { GaussianSplatElement as ElementClass, type GaussianSplatElement } from '@gaussian-splat/element';
import { detailFolder } from '../../support/detail-folder.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { isLab, itInLab, someOf } from '../../support/extent-in-pages.js';
import {
  assert,
  assertEqual,
  claimComing,
  COMPASS,
  delay,
  FIXTURES,
  frames,
  nextEvent,
  show,
  showLoaded,
  until,
} from './support/harness.js';

const GIF = 'data:image/gif;base64,R0lGODlhAQABAAAAACw=';
const STILL = { 'interpolation-decay': '0', 'interaction-prompt': 'none' };
const WEBGL = { renderer: 'webgl', 'camera-orbit': '0deg 90deg 8m', ...STILL };
/** PSNR in dB between two renderers' images of 8 bits. */
const MIN_DB = 50;

/** Contexts that the element has requested, and their draw calls. */
const contexts: WebGL2RenderingContext[] = [];
let draws = 0;
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function watching(this: HTMLCanvasElement, ...args: unknown[]) {
  const context = getContext.apply(this, args as Parameters<typeof getContext>);
  if (context instanceof WebGL2RenderingContext && !contexts.includes(context)) contexts.push(context);
  return context;
} as typeof getContext;
const drawElements = WebGL2RenderingContext.prototype.drawElementsInstanced;
WebGL2RenderingContext.prototype.drawElementsInstanced = function counting(...args) {
  draws++;
  drawElements.apply(this, args);
};

/** Programs that were linked, and questions for their status that came before the compilation had ended: these block the main thread. Some browsers cannot say. */
let [links, waits] = [0, 0];
const linkProgram = WebGL2RenderingContext.prototype.linkProgram;
WebGL2RenderingContext.prototype.linkProgram = function counting(program) {
  links++;
  linkProgram.call(this, program);
};
const askProgram = WebGL2RenderingContext.prototype.getProgramParameter;
WebGL2RenderingContext.prototype.getProgramParameter = function counting(program, name) {
  const extension = this.getExtension('KHR_parallel_shader_compile');
  if (name === this.LINK_STATUS && extension && !askProgram.call(this, program, extension.COMPLETION_STATUS_KHR))
    waits++;
  return askProgram.call(this, program, name) as unknown;
};

/** A .splat file of splats that cover the whole frame each, in different colors. */
function largeSplats(count: number): ArrayBuffer {
  const bytes = new DataView(new ArrayBuffer(32 * count));
  for (let i = 0; i < count; i++) {
    const floats = [Math.sin(i), Math.cos(2 * i), Math.sin(3 * i), 4, 4, 4];
    floats.forEach((value, k) => bytes.setFloat32(32 * i + 4 * k, value, true));
    const rest = [(37 * i) % 256, (91 * i) % 256, (53 * i) % 256, 12, 255, 128, 128, 128];
    rest.forEach((value, k) => bytes.setUint8(32 * i + 24 + k, value));
  }
  return bytes.buffer;
}

const pixelsOf = async (element: GaussianSplatElement): Promise<Uint8ClampedArray> => pixelsIn(await element.toBlob());

async function pixelsIn(photo: Blob): Promise<Uint8ClampedArray> {
  const image = await createImageBitmap(photo);
  const canvas = new OffscreenCanvas(image.width, image.height);
  const context = canvas.getContext('2d')!;
  context.drawImage(image, 0, 0);
  const { data } = context.getImageData(0, 0, image.width, image.height);
  // Colors of nearly transparent pixels have no meaning without alpha.
  return data.map((value, i) => (i % 4 === 3 ? value : (value * data[i | 3]) / 255));
}

function decibels(a: Uint8ClampedArray, b: Uint8ClampedArray): number {
  assertEqual(a.length, b.length, 'pixels');
  assert(
    b.some((value) => value !== b[0]),
    'an empty frame',
  );
  const sum = a.reduce((total, value, i) => total + (value - b[i]) ** 2, 0);
  return sum === 0 ? Infinity : 10 * Math.log10((255 ** 2 * a.length) / sum);
}

async function withoutGpu(test: () => Promise<void>): Promise<void> {
  Object.defineProperty(navigator, 'gpu', { configurable: true, value: undefined });
  try {
    await test();
  } finally {
    Reflect.deleteProperty(navigator, 'gpu');
  }
}

async function assertSame(attributes: Readonly<Record<string, string>>): Promise<void> {
  const images = [];
  for (const renderer of ['webgl', 'webgpu']) {
    const element = await showLoaded({ ...WEBGL, ...attributes, renderer });
    assertEqual([element.stats?.renderer, element.stats?.renderer], [renderer, renderer], 'renderer');
    images.push(await pixelsOf(element));
    element.remove();
  }
  const found = decibels(images[0], images[1]);
  assert(found >= MIN_DB, `${JSON.stringify(attributes)}: PSNR ${found.toFixed(1)} dB against WebGPU`);
}

describe('renderer="webgl"', () => {
  it("draws WebGPU's frame, from all sides", async () => {
    for (const orbit of someOf(['-75deg 120deg 2m', '130deg 60deg 5m', '0deg 90deg 8m'], 1))
      await assertSame({ 'camera-orbit': orbit });
    if (isLab) await assertSame({ quality: 'reference', 'max-sh-degree': '1', src: '/demo/dist/scenes/skull.spz' });
  });

  itInLab('draws with the filter that the page names', async () => {
    for (const filter of ['classic', 'antialiased', 'mip'])
      await assertSame({ filter, 'camera-orbit': '30deg 75deg 20m' });
  });

  itInLab('images of any size, over a color, are those of WebGPU', async () => {
    const options = { width: 333, height: 111, background: 'rgb(40 80 120)' };
    const taken = [];
    for (const renderer of ['webgl', 'webgpu']) {
      const element = await showLoaded({ ...WEBGL, renderer });
      const before = await pixelsOf(element);
      const image = await pixelsIn(await element.toBlob(options));
      assertEqual(image.length, 4 * 333 * 111, 'values');
      assert(
        image.every((value, i) => i % 4 !== 3 || value === 255),
        'nothing is transparent',
      );
      assertEqual(decibels(await pixelsOf(element), before), Infinity, 'the visible frame stays');
      taken.push(image);
      element.remove();
    }
    const found = decibels(taken[0], taken[1]);
    assert(found >= MIN_DB, `${found.toFixed(1)} dB`);
  });

  itInLab('flights move its camera', async () => {
    const element = await showLoaded(WEBGL);
    await element.flyTo({ orbit: '90deg 70deg 6m' }, { duration: 200 });
    assert(Math.abs(element.getCameraOrbit().theta - Math.PI / 2) < 1e-6, String(element.getCameraOrbit()));
    // Frames in motion may have fewer pixels.
    const canvas = element.shadowRoot!.querySelector('canvas')!;
    await until(() => canvas.toDataURL() === element.toDataURL(), 'the frame of the new view');
  });

  itInLab('an image that is read at once has the current camera', async () => {
    const element = await showLoaded(WEBGL);
    element.setAttribute('camera-orbit', '180deg 70deg 6m');
    element.jumpCameraToGoal();
    const atOnce = await pixelsOf(element);
    await delay(300);
    assertEqual(decibels(await pixelsOf(element), atOnce), Infinity, 'dB between at once and later');
  });

  it('a turn is drawn, with the order of the new view, and then nothing more', async () => {
    const element = await showLoaded(WEBGL);
    const canvas = (): HTMLCanvasElement => element.shadowRoot!.querySelector('canvas')!;
    element.setAttribute('camera-orbit', '180deg 70deg 6m');
    await delay(500);
    // A canvas of copies can be read at any time.
    const shown = canvas().toDataURL();
    assertEqual(shown, element.toDataURL(), 'the frame on the screen');
    await frames(3);
    const before = draws;
    await delay(500);
    assertEqual(draws, before, 'frames of an idle page');
  });

  itInLab('picks the point under the pointer, hides hotspots that the scene hides', async () => {
    document.body.style.margin = '0';
    const element = await showLoaded(WEBGL, 'width: 200px; height: 160px');
    const label = (name: string, position: string): HTMLElement => {
      const button = document.createElement('button');
      button.slot = `hotspot-${name}`;
      button.dataset.position = position;
      element.append(button);
      return button;
    };
    label('front', '0 0 1');
    label('behind', '0 0 -1');
    const point = await element.positionFromPoint(100, 80);
    assert(point && Math.hypot(point.x, point.y, point.z - 1) < 0.03, `found ${String(point)}`);
    assertEqual(await element.positionFromPoint(2, 2), null, 'beside the scene');
    // A race with the loss of the context would remain in memory as long as the scene.
    const { race } = Promise;
    let races = 0;
    Promise.race = function (this: typeof Promise, ...of: [never]) {
      races++;
      return race.apply(this, of);
    } as typeof race;
    for (let i = 0; i < 5; i++) await element.positionFromPoint(100, 80);
    Promise.race = race;
    assertEqual(races, 0, 'races');
    await until(() => element.queryHotspot('hotspot-front')?.visible === true, 'the label in front');
    await until(() => element.queryHotspot('hotspot-behind')?.visible === false, 'the label behind');
    assertEqual((await element.updateStats())?.drawn, element.stats?.splats, 'splats drawn');
  });

  itInLab('follows its size, and another renderer', async () => {
    const element = await showLoaded(WEBGL);
    element.style.width = '180px';
    await until(() => element.shadowRoot!.querySelector('canvas')!.width === 180, 'the new size');
    await delay(200);
    const webgl = await pixelsOf(element);
    for (const renderer of ['webgpu', 'webgl']) {
      element.setAttribute('renderer', renderer);
      await nextEvent(element, 'load');
      assertEqual(element.stats?.renderer, renderer, 'renderer');
      const found = decibels(await pixelsOf(element), webgl);
      assert(found >= MIN_DB, `${renderer}: ${found} dB`);
    }
  });

  it('all scenes of a page share three programs, and no thread waits for their compilation', async () => {
    const before = links;
    const elements = await Promise.all([WEBGL, WEBGL].map((attributes) => showLoaded(attributes)));
    assert(links - before <= 3, `${links - before} programs`);
    assertEqual(waits, 0, 'waits');
    const [first, second] = await Promise.all(elements.map(pixelsOf));
    assertEqual(decibels(first, second), Infinity, 'dB between the two');
  });

  it('a first frame that splats cover often is drawn in parts, and is the frame drawn at once', async () => {
    const path = '/net/kept/webgl-covered/large.splat';
    await fetch(path, { method: 'PUT', body: largeSplats(600) });
    const before = draws;
    const element = show({ ...WEBGL, src: path });
    await element.ready;
    assert(element.loaded, element.error?.message ?? 'loaded');
    const parts = draws - before;
    // The first part has a seventh of the pixels, and each next one at most four times as many.
    assert(parts >= 3, `${parts} parts`);
    const inParts = element.shadowRoot!.querySelector('canvas')!.toDataURL();
    assertEqual(inParts, element.toDataURL(), 'the frame');
    // Reading draws the frame once.
    assert(draws - before - parts <= 1, `${draws - before - parts} later draws`);
    element.remove();
  });

  it('a lost context comes back with the same frame', async () => {
    const element = await showLoaded(WEBGL);
    const before = await pixelsOf(element);
    const restored = nextEvent(element, 'contextrestored');
    const lost = nextEvent(element, 'contextlost');
    contexts.at(-1)?.getExtension('WEBGL_lose_context')?.loseContext();
    await lost;
    await restored;
    assertEqual(decibels(await pixelsOf(element), before), Infinity, 'dB');
    assertEqual(element.stats?.renderer, 'webgl', 'renderer');
  });

  itInLab('many elements share one context, which is given back', async () => {
    const first = contexts.length;
    const elements = await Promise.all(Array.from({ length: 20 }, () => showLoaded({ ...WEBGL, loading: 'eager' })));
    const images = await Promise.all(elements.map(pixelsOf));
    for (const image of images) assertEqual(decibels(image, images[0]), Infinity, 'dB');
    assert(contexts.length - first <= 1, `${contexts.length - first} contexts`);
    const gl = contexts.at(-1)!;
    for (const element of elements) element.remove();
    await until(() => gl.isContextLost(), 'the end of the context');
  });

  itInLab('a scene whose order does not arrive is replaced by the next one', async () => {
    const original = ElementClass.sceneLoader;
    const Loader = original.constructor as new (spawn: () => Worker) => typeof original;
    const script = new URL('/packages/element/dist/loading/scene-worker.js', location.href).href;
    const code = `addEventListener('message', (event) => { if (event.data.type === 'sort') event.stopImmediatePropagation(); });
      await import(${JSON.stringify(script)});`;
    const url = URL.createObjectURL(new Blob([code], { type: 'text/javascript' }));
    let asked = false;
    ElementClass.sceneLoader = new Loader(() => {
      const worker = new Worker(url, { type: 'module' });
      const post = worker.postMessage.bind(worker) as (message: { type: string }, transfer: Transferable[]) => void;
      worker.postMessage = (message: { type: string }, transfer: unknown = []) => {
        if (message.type === 'sort') asked = true;
        post(message, transfer as Transferable[]);
      };
      return worker;
    });
    try {
      const element = show({ src: COMPASS, ...WEBGL });
      await until(() => asked, 'an order is asked for');
      element.src = `${COMPASS}?next`;
      await element.ready;
      assert(element.loaded, element.error?.message ?? 'loaded');
    } finally {
      ElementClass.sceneLoader = original;
      URL.revokeObjectURL(url);
    }
  });

  itInLab('where the page refuses workers its own thread sorts', async () => {
    const original = ElementClass.sceneLoader;
    const Loader = original.constructor as new (spawn: () => Worker) => typeof original;
    ElementClass.sceneLoader = new Loader(() => {
      throw new Error('refused');
    });
    try {
      const element = await showLoaded(WEBGL);
      await claimComing(/no worker could be started \(refused\)/);
      element.setAttribute('camera-orbit', '180deg 70deg 6m');
      await delay(300);
      assertEqual(element.shadowRoot!.querySelector('canvas')!.toDataURL(), element.toDataURL(), 'the frame');
    } finally {
      ElementClass.sceneLoader = original;
    }
  });

  /** Puts the folder of a streamed scene at an address of this page. */
  async function putPages(name: string): Promise<Readonly<Record<string, string>>> {
    const folder = detailFolder(pebbles(20_000), undefined, { geometry: 'quantized' });
    const put = (path: string, body: BodyInit): Promise<Response> =>
      fetch(`/net/kept/${name}/${path}`, { method: 'PUT', body });
    for (const [path, bytes] of folder.files) await put(path, bytes);
    await put('detail.json', JSON.stringify(folder.manifest));
    return { ...WEBGL, src: `/net/kept/${name}/detail.json` };
  }

  itInLab('a scene in pages is drawn whole if it fits', async () => {
    const element = show(await putPages('webgl-pages'));
    await element.ready;
    assert(element.loaded, element.error?.message ?? 'loaded');
    assertEqual(element.stats?.renderer, 'webgl', 'renderer');
    assertEqual(element.stats?.splats, 20_000, 'splats');
    element.remove();
  });

  it('a scene in pages that exceeds its budget is drawn within it, its coarsest page first', async () => {
    const budget = 800_000;
    ElementClass.memoryBudget = budget;
    try {
      const gate = `webgl-${Math.round(performance.timeOrigin)}`;
      const pages = await putPages('webgl-budget');
      // The manifest and the coarsest page.
      const element = show({ ...pages, src: `${pages.src}?passing=2&gate=${gate}` });
      const { detail } = await nextEvent<CustomEvent<{ splats: number }>>(element, 'preview');
      await fetch(`/net/open/${gate}`);
      await element.ready;
      assert(element.loaded, element.error?.message ?? 'loaded');
      const { splats, bytes } = element.stats!;
      assert(detail.splats > 0 && 4 * detail.splats < splats, `first ${detail.splats}, then ${splats} splats`);
      assert(bytes.scene <= budget, `${bytes.scene} of ${budget} bytes`);
      // Half of the budget at least is used: it limits the scene, and nothing else does.
      assert(splats < 20_000 && 2 * bytes.scene > budget, `${splats} splats, ${bytes.scene} bytes`);
      element.remove();
    } finally {
      ElementClass.memoryBudget = null;
    }
  });

  it('what it cannot show is an error by name, the poster stays, and nothing is fetched', async () => {
    const generators = '/tests/fixtures/generators/';
    const cases: readonly (readonly [Readonly<Record<string, string>>, RegExp])[] = [
      [{ src: `${generators}packed.onnx` }, /found a generator/],
      [{ src: COMPASS, postprocess: `${generators}post.onnx` }, /found a post-processor/],
    ];
    for (const [attributes, text] of cases) {
      const element = show({ ...WEBGL, ...attributes, poster: GIF });
      await nextEvent(element, 'error');
      assertEqual(element.error?.reason, 'unsupported/webgl');
      assert(text.test(element.error?.message ?? ''), element.error?.message ?? '');
      await element.updateComplete;
      assert(element.shadowRoot?.querySelector('.poster:not(.gone) img'), 'the poster is there');
      assertEqual(element.shadowRoot?.querySelector('[part=fallback], [part=error]'), null, 'nothing over the poster');
      element.remove();
    }
    const fetched = performance
      .getEntriesByType('resource')
      .filter(({ name }) => /packed\.onnx|post\.onnx|nowhere/.test(name));
    assertEqual(fetched.length, 0, 'requests');
  });
});

describe('scenes and meshes beside the scene', () => {
  const CHILDREN = `<splat-scene src="${COMPASS}"></splat-scene><splat-mesh src="/nowhere/unfetched.glb"></splat-mesh>`;
  const reasonsOf = (element: GaussianSplatElement): (string | undefined)[] =>
    [...element.querySelectorAll<SplatSceneElement | SplatMeshElement>('splat-scene, splat-mesh')].map(
      ({ error }) => error?.reason,
    );

  for (const renderer of ['webgl', 'auto'])
    it(`renderer="${renderer}": they are an error by name, each, and the poster stays`, async () => {
      await withoutGpu(async () => {
        for (const src of [COMPASS, '']) {
          const element = show({ ...WEBGL, renderer, poster: GIF, ...(src && { src }) });
          element.innerHTML = CHILDREN;
          await until(() => reasonsOf(element).every(Boolean), 'errors of the children');
          await until(() => element.error !== null, 'an error of the element');
          assertEqual(reasonsOf(element), ['unsupported/webgl', 'unsupported/webgl'], 'reasons');
          assert(/found a <splat-scene> or <splat-mesh>/.test(element.error!.message), element.error!.message);
          await element.updateComplete;
          const root = element.shadowRoot!;
          assert(root.querySelector('.poster:not(.gone) img'), 'the poster is there');
          assertEqual(root.querySelector('[part=fallback], [part=error]'), null, 'nothing over the poster');
          element.remove();
        }
      });
    });

  it('one that comes later is refused, and the scene stays', async () => {
    const element = await showLoaded(WEBGL);
    const before = await pixelsOf(element);
    element.innerHTML = CHILDREN;
    await until(() => reasonsOf(element).every(Boolean), 'errors of the children');
    assertEqual(reasonsOf(element), ['unsupported/webgl', 'unsupported/webgl'], 'reasons');
    assertEqual([element.error, element.loaded], [null, true], 'the scene');
    assertEqual(decibels(await pixelsOf(element), before), Infinity, 'dB');
  });
});

describe('without WebGPU', () => {
  it('WebGL draws automatically', async () => {
    await withoutGpu(async () => {
      const element = await showLoaded({ ...WEBGL, renderer: 'auto', src: `${FIXTURES}compass.ply` });
      assertEqual(element.stats?.renderer, 'webgl', 'renderer');
      assert(element.matches(':state(ready)') && !element.matches(':state(unsupported)'), 'states');
    });
  });

  it('nor WebGL: the reason is why there is no WebGPU', async () => {
    const watched = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = () => null;
    try {
      await withoutGpu(async () => {
        const element = show({ src: `${COMPASS}?unfetched` });
        await nextEvent(element, 'error');
        assertEqual(element.error?.reason, 'unsupported/no-webgpu');
        const fetched = performance.getEntriesByType('resource').filter(({ name }) => name.includes('unfetched'));
        assertEqual(fetched.length, 0, 'requests');
      });
    } finally {
      HTMLCanvasElement.prototype.getContext = watched;
    }
  });
});
