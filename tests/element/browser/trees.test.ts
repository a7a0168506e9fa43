/** Scenes whose files are trees of levels, 3D Tiles, LCC, LCC2 and RAD, by view: requests, memory, and frames. */
import { GaussianSplatElement } from '@gaussian-splat/element';
import { writeLcc } from '../../formats/support/lcc-writer.js';
import { writeLcc2 } from '../../formats/support/lcc2-writer.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { pick } from '../../support/lod-folder.js';
import { writeRadTree } from '../../support/rad-tree.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { splatTileset, type TilesetFiles, type TilesetOptions } from '../../support/tileset.js';
import { assert, assertEqual, frames, show, submits, until } from './support/harness.js';

/** 100,000 splats in four levels of tiles, 85 at most; and 4,000 in nine tiles of three, which SwiftShader draws sooner. */
const LARGE = { cloud: pebbles(100_000), levels: 4 };
const PEBBLES = pebbles(12_000);
const everyThird = Array.from({ length: 4_000 }, (_, i) => 3 * i);
const FEW = { cloud: pick(PEBBLES, everyThird, 1.7), levels: 3 };

interface Served {
  readonly src: string;
  readonly files: TilesetFiles;
  readonly put: (path: string, bytes: Uint8Array) => Promise<unknown>;
  /** Requested files, in order. */
  readonly log: () => Promise<readonly string[]>;
}

let folders = 0;

/** Puts files on the server, except for the lost ones. */
async function serve(files: TilesetFiles, main: string, lost = /$^/): Promise<Served> {
  const address = `/net/kept/trees-${++folders}/`;
  const put = (path: string, bytes: Uint8Array): Promise<unknown> =>
    fetch(address + path, { method: 'PUT', body: bytes.slice() });
  for (const [path, bytes] of files) if (!lost.test(path)) await put(path, bytes);
  return {
    ...{ src: `${address}${main}`, files, put },
    log: async () => (await (await fetch(`${address}log`)).json()) as string[],
  };
}

const tiles = (options: Partial<TilesetOptions> = {}, lost?: RegExp, { cloud, levels } = FEW): Promise<Served> =>
  serve(splatTileset(cloud, { levels, ...options }), 'tileset.json', lost);

/** Colors of the current frame. */
async function pixelsOf(element: GaussianSplatElement): Promise<Uint8ClampedArray> {
  const bitmap = await createImageBitmap(await element.toBlob());
  const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
  context.drawImage(bitmap, 0, 0);
  return context.getImageData(0, 0, bitmap.width, bitmap.height).data;
}

/** An image, moved to the right. Its left columns repeat. */
const shifted = (image: Uint8ClampedArray, pixels: number): Uint8ClampedArray =>
  image.map((_, i) => {
    const x = (i >> 2) % WIDTH;
    return image[i - 4 * Math.min(x, pixels)];
  });

/** PSNR of two images that show something, in dB. */
function psnr(a: Uint8ClampedArray, b: Uint8ClampedArray): number {
  const covered = b.filter((value, k) => value !== b[k % 4]).length / b.length;
  assert(covered > 0.05, `an image of more than one color: ${covered} of it`);
  const sum = a.reduce((total, value, i) => total + (value - b[i]) ** 2, 0);
  return 10 * Math.log10(255 ** 2 / Math.max(1e-9, sum / a.length));
}

/** Waits until no page that the view needs is in transit, and no request follows. */
async function calm(element: GaussianSplatElement, { log }: Served): Promise<readonly string[]> {
  // A view gets its feedback passes within a few frames, and one more after each page.
  for (let [seen, calm] = ['', 0]; calm < 3;) {
    await frames(8);
    const { length } = await log();
    const [{ coming, resident, limit }] = element.stats!.streamed;
    const state = `${length} ${resident} ${limit} ${submits}`;
    calm = coming === 0 && limit !== 'transit' && state === seen ? calm + 1 : 0;
    seen = state;
  }
  return log();
}

async function close(element: GaussianSplatElement): Promise<void> {
  element.removeAttribute('src');
  await until(() => !element.loaded, 'the scene is let go');
  element.remove();
}

/** Small, because SwiftShader draws near splats for seconds. */
const WIDTH = 64;
const SIZE = `width: ${WIDTH}px; height: 48px`;
const FAR = { 'camera-orbit': '30deg 60deg 900m', 'camera-target': '0m 0m 0m' };

/** A view of the stone of a splat, whose position is in the frame of glTF. */
const viewOf = ({ cloud }: typeof FEW, splat: number, toViewer = ([x, y, z]: number[]) => [-x, y, -z]): View => ({
  'camera-orbit': '30deg 60deg 2.5m',
  'camera-target': toViewer([...cloud.positions.subarray(3 * splat, 3 * splat + 3)])
    .map((x) => `${x}m`)
    .join(' '),
});
type View = Record<string, string>;
const [NEAR, THERE] = [viewOf(FEW, 0), viewOf(FEW, 1)];

async function opened(served: Served, attributes: Record<string, string>): Promise<GaussianSplatElement> {
  const element = show({ src: served.src, ...attributes }, SIZE);
  await element.ready;
  assert(element.loaded, `loaded: ${element.error?.message}`);
  return element;
}

const move = (element: GaussianSplatElement, view: Record<string, string>): void =>
  Object.entries(view).forEach(([name, value]) => element.setAttribute(name, value));

const bytesOf = (log: readonly string[], { files }: Served): number =>
  log.reduce((sum, path) => sum + (files.get(path)?.length ?? 0), 0);

/** Memory for a few of the finest tiles, for all tiles of the small scene, and for those of the large one. */
const [LITTLE, AMPLE, LARGE_BYTES] = [1.7e5, 8.5e5, 7e6];

/** The same scene, complete and in its finest level. */
const whole = (served: Served, view: Record<string, string>): Promise<GaussianSplatElement> => {
  GaussianSplatElement.memoryBudget = null;
  return opened(served, { ...view, detail: 'off' });
};

describe('a tileset', () => {
  beforeEach(() => void (GaussianSplatElement.memoryBudget = AMPLE));
  after(() => void (GaussianSplatElement.memoryBudget = null));

  itInLab(
    'of 100,000 splats loads its root, then the tiles that each view needs, and shows what the whole scene shows',
    async () => {
      GaussianSplatElement.memoryBudget = LARGE_BYTES;
      const served = await tiles({}, undefined, LARGE);
      const element = await opened(served, { ...FAR, detail: '3px' });
      assertEqual((await calm(element, served)).join(' '), 'tileset.json 0/0-0.glb', 'from afar');
      move(element, { ...NEAR, 'camera-target': '-3m 0m -3m' });
      const near = await calm(element, served);
      const there = { ...NEAR, 'camera-target': '3m 0m 3m' };
      move(element, there);
      const both = await calm(element, served);
      const finest = (paths: readonly string[]): string[] => paths.filter((path) => path.startsWith('3/'));
      assertEqual(new Set(both).size, both.length, 'each file once');
      assert(
        finest(near).length > 0 && finest(both).length > finest(near).length,
        `${near.join(' ')}; ${both.join(' ')}`,
      );
      const [all, some] = [bytesOf([...served.files.keys()], served), bytesOf(near, served)];
      console.log(
        `near: ${near.length} of ${served.files.size} files, ${some} of ${all} bytes; both views: ${both.length}`,
      );
      assert(near.length < served.files.size, 'not all files');
      const reference = await whole(await tiles({}, undefined, LARGE), there);
      const truth = await pixelsOf(reference);
      const decibels = [psnr(await pixelsOf(element), truth)];
      element.setAttribute('detail', '0.02px');
      await calm(element, served);
      decibels.push(psnr(await pixelsOf(element), truth));
      const { streamed, total } = element.stats!;
      // Shifts of the whole scene itself: half a pixel has about 6 dB more than one.
      const [one, three] = [1, 3].map((pixels) => psnr(shifted(truth, pixels), truth));
      decibels.push(one, three);
      const text = decibels.map((value) => value.toFixed(1)).join(', ');
      console.log(
        `${text} dB at 3 px, 0.02 px, shifted by 1 and 3 px; ${streamed[0].bytes} bytes, ${total} splats known`,
      );
      assert(decibels[0] > one + 4 && decibels[1] > 60, `${text} dB`);
      await close(element);
      await close(reference);
    },
  );

  itInLab(
    'whose tiles are in subtrees, or in tilesets of their own, loads those parts when the view needs them',
    async () => {
      const kinds = [
        [{ isImplicit: true }, /^subtrees.*json$/],
        [{ nestedAt: 2 }, /^in\//],
      ] as const;
      for (const [options, part] of kinds) {
        const served = await tiles(options);
        const element = await opened(served, FAR);
        const far = (await calm(element, served)).filter((path) => part.test(path));
        assertEqual(far.length, 'isImplicit' in options ? 1 : 0, far.join(' '));
        move(element, NEAR);
        const near = await calm(element, served);
        const [own, all] = [near, [...served.files.keys()]].map(
          (paths) => paths.filter((path) => part.test(path)).length,
        );
        console.log(`${part.source}: ${own} of ${all} parts of the manifest, ${near.length} requests`);
        assert(own > far.length && own <= all && near.some((path) => path.startsWith('2/')), near.join(' '));
        await close(element);
      }
    },
  );

  itInLab('stays within little memory with coarser tiles, and within the limit of splats of a page', async () => {
    GaussianSplatElement.memoryBudget = LITTLE;
    const served = await tiles();
    const element = await opened(served, NEAR);
    for (const view of [THERE, NEAR]) {
      move(element, view);
      await calm(element, served);
      const [{ bytes, limit, resident }] = element.stats!.streamed;
      console.log(`${resident} tiles, ${bytes} bytes, missing for: ${limit}`);
      assert(bytes <= LITTLE, `${bytes} bytes`);
      assertEqual([element.error, element.loaded], [null, true]);
    }
    assertEqual(element.stats!.streamed[0].limit, 'memory');
    await close(element);
    GaussianSplatElement.memoryBudget = AMPLE;
    GaussianSplatElement.sceneLimits = { maxSplats: 400 };
    const limited = await opened(await tiles(), NEAR);
    GaussianSplatElement.sceneLimits = {};
    await close(limited);
  });

  it('stays visible if a tile is missing or damaged, with a word; a missing root is an error with a name', async () => {
    const served = await tiles({}, /^1\/1-0/);
    await served.put('1/1-1.glb', new TextEncoder().encode('glTF, or not'));
    const warned: string[] = [];
    const original = console.warn;
    console.warn = (message: unknown) => void warned.push(String(message));
    const element = await opened(served, { 'camera-orbit': '30deg 60deg 4m', 'camera-target': '0m 0m 0m' });
    await until(() => warned.some((message) => /1\/1-0\.glb.*404/s.test(message)), 'a word on the missing tile');
    await until(() => warned.some((message) => message.includes('1/1-1.glb')), 'a word on the damaged tile');
    assert(element.loaded && element.error === null, 'still visible');
    await until(() => element.stats!.streamed[0].resident > 1, 'the other tiles');
    await close(element);
    console.warn = original;
    const rootless = show({ src: (await tiles({}, /^0\//)).src });
    await rootless.ready;
    assertEqual(rootless.error?.reason, 'network/status');
    rootless.remove();
    const broken = await serve(
      new Map([['tileset.json', new TextEncoder().encode('{"geometricError": 1, "root": 3}')]]),
      'tileset.json',
    );
    const wrong = show({ src: broken.src });
    await wrong.ready;
    assertEqual(wrong.error?.reason, 'decode/header');
    wrong.remove();
  });

  itInLab('on the Earth has its vertical axis, and all tiles that a view needs', async () => {
    const [lon, lat] = [0.2, 0.8];
    const up = [Math.cos(lat) * Math.cos(lon), Math.cos(lat) * Math.sin(lon), Math.sin(lat)];
    const north = [-Math.sin(lat) * Math.cos(lon), -Math.sin(lat) * Math.sin(lon), Math.cos(lat)];
    const place = up.map((x) => 6.37e6 * x);
    const transform = [-Math.sin(lon), Math.cos(lon), 0, 0, ...north, 0, ...up, 0, ...place, 1];
    const view = viewOf(FEW, 0, ([x, y, z]) => {
      const earth = [0, 1, 2].map((k) => place[k] + x * transform[k] - z * transform[4 + k] + y * transform[8 + k]);
      return [-earth[0], -earth[2], -earth[1]];
    });
    const served = await tiles({ transform });
    const element = await opened(served, { ...view, detail: '0.02px' });
    await calm(element, served);
    const sky = element.stats!.up!.map((x, k) => Math.abs(x + [up[0], up[2], up[1]][k]));
    assert(Math.max(...sky) < 1e-4, sky.join(' '));
    assertEqual(element.stats!.streamed[0].error, 0, 'pixels that are missing');
    await close(element);
  });
});

describe('LCC of three levels', () => {
  it('loads the coarsest level of its cells, then ranges of its file that the view needs', async () => {
    GaussianSplatElement.memoryBudget = AMPLE;
    const { cloud } = FEW;
    const view = viewOf(FEW, 0, (place) => place);
    const order = Array.from({ length: cloud.count }, (_, i) => i);
    order.sort((a, b) => cloud.positions[3 * a] - cloud.positions[3 * b]);
    const levels = [0, 1, 2].map((level) => {
      const part = pick(
        cloud,
        order.filter((_, k) => k % 4 ** level === 0),
        2 ** level,
      );
      const stride = part.sh.length / part.count;
      const sh = Float32Array.from({ length: 3 * part.count }, (_, k) => part.sh[stride * Math.floor(k / 3) + (k % 3)]);
      return { ...part, shDegree: 0 as const, sh };
    });
    const files = writeLcc(levels, { cellCount: 8 });
    const served = await serve(new Map(Object.entries(files)), 'meta.lcc?ranges');
    const element = await opened(served, FAR);
    const far = await calm(element, served);
    assertEqual(far.filter((path) => path.startsWith('data.bin')).length, 8, far.join(', '));
    assert(
      far.every((path) => path !== 'data.bin'),
      'never the whole file',
    );
    move(element, view);
    const near = await calm(element, served);
    assert(near.length > far.length, near.join(', '));
    const bytes = near.reduce((sum, path) => {
      const [, first, last] = /^data\.bin (\d+)-(\d+)$/.exec(path) ?? [];
      return sum + (first === undefined ? 0 : Number(last) + 1 - Number(first));
    }, 0);
    console.log(`${near.length} requests, ${bytes} of ${files['data.bin'].length} bytes`);
    await close(element);
    GaussianSplatElement.memoryBudget = null;
  });
});

describe('LCC2 of three levels', () => {
  itInLab(
    'loads its coarsest files, then those that the view needs, each once, and shows what the whole scene shows',
    async () => {
      GaussianSplatElement.memoryBudget = AMPLE;
      const view = viewOf(FEW, 0, ([x, y, z]) => [x, z, -y]);
      const served = await serve(new Map(Object.entries(writeLcc2(FEW.cloud, { levels: 3 }))), 'scene.lcc2');
      const element = await opened(served, { ...FAR, detail: '3px' });
      const far = await calm(element, served);
      assertEqual(far.toSorted().join(' '), 'data/3dgs/1-0.sog data/3dgs/1-1.sog scene.lcc2', 'from afar');
      move(element, { ...view, detail: '0.02px' });
      const near = await calm(element, served);
      assert(near.includes('data/3dgs/3-0.sog') || near.includes('data/3dgs/3-1.sog'), near.join(', '));
      assertEqual(new Set(near).size, near.length, near.join(', '));
      const reference = await whole(served, view);
      const truth = await pixelsOf(reference);
      const [streamed, half] = [psnr(await pixelsOf(element), truth), psnr(shifted(truth, 1), truth)];
      console.log(
        `${near.length} requests; ${streamed.toFixed(1)} dB PSNR against the whole, a shift of a pixel ${half.toFixed(1)}`,
      );
      assert(streamed > half + 6, `${streamed} dB`);
      await close(reference);
      await close(element);
      GaussianSplatElement.memoryBudget = null;
    },
  );
});

describe('RAD', () => {
  const SCENE = { cloud: PEBBLES, levels: 3 };
  /** Memory for a few of the finest chunks; five times as much is enough for all. */
  const MIDDLE = 5e5;
  const rad = (options: { isFlat?: boolean } = {}, { cloud } = SCENE): Promise<Served> =>
    serve(new Map([['scene.rad', writeRadTree(cloud, { chunkSize: 2048, ...options })]]), 'scene.rad?ranges');
  /** The file has the axes of a cloud: y down. */
  const viewAt = (splat: number): View => viewOf(SCENE, splat, ([x, y, z]) => [x, -y, -z]);
  before(() => void (GaussianSplatElement.memoryBudget = 5 * MIDDLE));
  after(() => void (GaussianSplatElement.memoryBudget = null));

  it('loads its description and the first chunk, then the chunks that the view needs; at last it is the whole scene', async () => {
    const served = await rad();
    const element = await opened(served, FAR);
    const far = await calm(element, served);
    assert(far.length >= 2 && far.every((path) => /^scene\.rad \d+-\d+$/.test(path)), far.join(', '));
    move(element, { ...viewAt(0), detail: '0.02px' });
    const near = await calm(element, served);
    assert(near.length > far.length, near.join(', '));
    assertEqual(element.stats!.streamed[0].error, 0, 'pixels that are missing');
    const all = Math.ceil(served.files.get('scene.rad')!.length / 1000);
    const bytes = near.reduce((sum, path) => {
      const [, first, last] = /(\d+)-(\d+)$/.exec(path)!;
      return sum + Number(last) + 1 - Number(first);
    }, 0);
    const reference = await whole(await rad(), viewAt(0));
    const compared = async (): Promise<number> => psnr(await pixelsOf(element), await pixelsOf(reference));
    // On a busy machine the GPU's answer for the new view may follow the requests of the old one by many frames.
    let decibels = await compared();
    for (let rounds = 0; decibels <= 55 && rounds < 100; rounds++) {
      await calm(element, served);
      decibels = await compared();
    }
    console.log(`${far.length}, then ${near.length} requests, ${bytes} bytes of ${all} kB; ${decibels.toFixed(1)} dB`);
    assert(decibels > 55, `${decibels} dB`);
    await close(element);
    await close(reference);
  });

  itInLab('is coarser within little memory, without an error', async () => {
    GaussianSplatElement.memoryBudget = MIDDLE;
    const served = await rad();
    const element = await opened(served, { ...viewAt(0), detail: '0.02px' });
    await calm(element, served);
    const [{ bytes, limit, resident }] = element.stats!.streamed;
    console.log(`${resident} pages, ${bytes} bytes, missing for: ${limit}`);
    assert(bytes <= MIDDLE && resident > 1, `${bytes} bytes, ${resident} pages`);
    assertEqual([element.error, element.loaded, limit], [null, true, 'memory']);
    await close(element);
    GaussianSplatElement.memoryBudget = 5 * MIDDLE;
  });

  it('without levels is loaded whole', async () => {
    const served = await rad({ isFlat: true });
    const element = await opened(served, viewAt(0));
    assertEqual([element.stats!.total, element.stats!.streamed.length], [SCENE.cloud.count, 0]);
    await close(element);
  });
});
