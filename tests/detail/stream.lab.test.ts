/** Scenes that are streamed: pages are loaded and evicted, and the resident ones always cover the scene. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { setTimeout as pause } from 'node:timers/promises';
import type { Camera, Vector3 } from '@gaussian-splat/core';
import {
  checkManifest,
  GaussianBuffers,
  MemoryLedger,
  packGaussians,
  StreamedGaussians,
} from '@gaussian-splat/renderer';
import { packWithDetail, readPacked } from '@gaussian-splat/renderer/tools';
import { constants, listPages, NONE, SLOT_CHUNKS, Residency } from '@gaussian-splat/renderer/stages';
import { detailFolder, type DetailFolder } from '../support/detail-folder.js';
import { isLab } from '../support/extent.js';
import { shareDrawn, type DetailView } from '../support/detail-twin.js';
import { randomSource } from '../support/gpu.js';
import { psnr } from '../support/metrics.js';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';
import { readRows } from '../support/read-rows.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { Renderer } from '../support/renderer.js';

const cloud = pebbles(20_000);
const folder = detailFolder(cloud);
const options = { threads: 'serial', sort: 'serial' } as const;
const viewFrom = (distance: number, angle = 0.4, target: Vector3 = [0, 0, 0]): Camera =>
  cameraAt([distance * Math.cos(angle), -0.5 * distance, distance * Math.sin(angle)], target, {
    ...{ width: 96, height: 64, fovXDegrees: 60, near: 0.01 },
  });

const openAll = async (source: DetailFolder, memoryBudget?: number): Promise<StreamedGaussians> =>
  StreamedGaussians.open(await anyDevice(), source.manifest, { fetchPage: source.fetchPage, memoryBudget });

test('a scene with slots for all its pages is drawn as the scene that was loaded completely', async () => {
  const device = await anyDevice();
  const whole = await GaussianBuffers.upload(device, packWithDetail(cloud));
  const scene = await openAll(folder);
  const [streaming, loaded] = [new Renderer(device, options), new Renderer(device, options)];
  for (const [camera, detail] of [
    [viewFrom(40), 1] as const,
    [viewFrom(14, 1), 0.5] as const,
    [viewFrom(8, 2), 0] as const,
  ]) {
    await drawUntilCalm(scene, streaming, camera, detail);
    const expected = await readFrame(device, loaded, { gaussians: whole, camera, detail });
    const found = await readFrame(device, streaming, { gaussians: scene, camera, detail });
    const close = psnr(expected, found, { channels: 4 });
    const { resident, total } = scene.progress;
    console.log(`detail ${detail}: ${close.toFixed(1)} dB with ${resident} of ${total} pages`);
    assert.ok(close > 65, `${close} dB`);
    assert.equal(scene.progress.error, 0, 'all that is asked for is there');
  }
  assert.ok(scene.progress.resident > 1);
  [streaming, loaded, scene, whole].forEach((owner) => owner.destroy());
});

test('a scene that is read back is what was uploaded', async () => {
  const packed = packGaussians(cloud);
  const scene = await GaussianBuffers.upload(await anyDevice(), packed);
  assert.deepEqual(await readPacked(await anyDevice(), scene), packed);
  scene.destroy();
});

test('a streamed scene is not read back as if it were whole', async () => {
  const scene = await openAll(folder);
  await assert.rejects(readPacked(await anyDevice(), scene), { code: 'argument/value' });
  scene.destroy();
});

/** Detail rows by page, as they are on the GPU. */
async function rowsOfPages(scene: StreamedGaussians): Promise<Map<number, Float32Array>> {
  const rows = await readRows(scene);
  return new Map(scene.pagesInSlots.flatMap((page, slot) => (page === undefined ? [] : [[page, rows[slot]] as const])));
}

/** Sums weights along every path from the coarsest chunk to the finest resident one: each sum must be 1. */
function checkCovered(source: DetailFolder, rows: ReadonlyMap<number, Float32Array>, view: DetailView): number {
  const list = listPages(source.manifest);
  let paths = 0;
  const walk = (page: number, chunk: number, above: number): void => {
    const sum = above + shareDrawn(rows.get(page)!, chunk, view);
    const next = below(list, page, chunk, rows);
    if (next.length === 0) {
      paths++;
      assert.ok(Math.abs(sum - 1) < 1e-4, `page ${page}, chunk ${chunk}: covered ${sum} times`);
    }
    for (const [p, c] of next) walk(p, c, sum);
  };
  walk(0, 0, 0);
  return paths;
}

/** Resident chunks that one chunk represents. */
function below(
  list: ReturnType<typeof listPages>,
  page: number,
  chunk: number,
  rows: ReadonlyMap<number, Float32Array>,
): [page: number, chunk: number][] {
  const child = list.children[SLOT_CHUNKS * page + chunk];
  return child !== NONE && rows.has(child) ? Array.from({ length: list.chunks[child] }, (_, c) => [child, c]) : [];
}

const COPIES = [0, 1, 2, 3, 4, 5, 6].map((k) => [14 * (k % 3), 0, 14 * (k >> 1)] as const);
for (const [name, make] of [
  ['one tree', () => detailFolder(pebbles(60_000))] as const,
  ['copies of a tree', () => detailFolder(pebbles(4_000), COPIES)] as const,
]) {
  test(`${name}: with room for a third of the pages, every place is covered exactly once wherever the camera goes`, async () => {
    const source = make();
    const list = listPages(source.manifest);
    const slots = Math.ceil(list.count / 3);
    const bytes = 4 * SLOT_CHUNKS * (8 + 12 + constants.CULL_GROUP * (8 + 4));
    const scene = await openAll(source, slots * bytes);
    assert.equal(scene.pagesInSlots.length, slots);
    const renderer = new Renderer(await anyDevice(), options);
    const seen = new Set<number>();
    let max = 0;
    for (const [k, distance] of [30, 3, 2, 60, 1.5, 2.5].entries()) {
      const camera = viewFrom(distance, k, [2 * k - 5, 0, 3 - k]);
      await drawUntilCalm(scene, renderer, camera, 0.2);
      max = Math.max(max, scene.progress.error);
      const rows = await rowsOfPages(scene);
      for (const page of rows.keys()) seen.add(page);
      for (const fade of [0, 0.5]) assert.ok(checkCovered(source, rows, { camera, allowed: 0.2, fade }) > 3);
    }
    assert.ok(max > 0.2, `${max} pixels: the pool is too small for some of these views`);
    assert.ok(seen.size > slots, `only ${seen.size} of ${list.count} pages were ever there: none left for another`);
    renderer.destroy();
    scene.destroy();
  });
}

/** A camera that comes nearer and moves to the next copy. */
const flightOver = (frame: number): Camera =>
  viewFrom(2 + 10 * Math.abs(Math.sin(frame / 9)), frame / 20, [14 * ((frame >> 4) % 3), 0, 14 * ((frame >> 5) % 3)]);

test('in a flight, with pages that come in any order and leave before they have arrived, every place is covered exactly once in every frame', async () => {
  const random = randomSource(12);
  const device = await anyDevice();
  const source = detailFolder(
    pebbles(9_000),
    [0, 1, 2, 3, 4, 5, 6, 7, 8].map((k) => [14 * (k % 3), 0, 14 * Math.floor(k / 3)] as const),
  );
  const list = listPages(source.manifest);
  const late = async (file: string): Promise<ArrayBuffer> => {
    await pause(15 * random());
    return source.fetchPage(file);
  };
  const memoryBudget = Math.ceil(list.count / 3) * 4 * SLOT_CHUNKS * (8 + 12 + constants.CULL_GROUP * (8 + 4));
  const scene = await StreamedGaussians.open(device, source.manifest, {
    fetchPage: late,
    memoryBudget,
    arrivalMs: 150,
  });
  const renderer = new Renderer(device, options);
  const target = device.createTexture({ size: [96, 64], format: 'rgba8unorm', usage: 0x10 });
  let [arriving, exchanged] = [0, 0];
  let before = new Set<number>();
  for (let frame = 0; frame < (isLab ? 90 : 60); frame++) {
    const camera = flightOver(frame);
    renderer.render({ gaussians: scene, camera, target, detail: 0.2, splatBudget: 30_000 });
    await device.queue.onSubmittedWorkDone();
    // However fast the GPU is, pages have time to come.
    await pause(8);
    const rows = await rowsOfPages(scene);
    for (const fade of [0, 0.5]) checkCovered(source, rows, { camera, allowed: 0.2, fade });
    if ([...before].some((page) => !rows.has(page))) exchanged++;
    if (scene.progress.coming > 0) arriving++;
    before = new Set(rows.keys());
  }
  const seen = `${arriving} frames with pages on their way, ${exchanged} in which some left`;
  console.log(seen);
  assert.ok(arriving > 20 && exchanged > 2, seen);
  [renderer, scene, target].forEach((owner) => owner.destroy());
});

test('a view that turns to the scene lacks nothing, though hardly anything was visible for long', async () => {
  const device = await anyDevice();
  const places = Array.from({ length: 140 }, (_, k) => [9 * (k % 12), 0, 9 * Math.floor(k / 12)] as const);
  // The pool has room for more splats than are asked for.
  const scene = await openAll(detailFolder(pebbles(300), places));
  // Whose room for pairs is watched, and that for splats with it.
  const renderer = new Renderer(device, { ...options, rasterizer: 'tiles' });
  const target = device.createTexture({ size: [96, 64], format: 'rgba8unorm', usage: 0x10 });
  const look = async (at: Vector3): Promise<void> => {
    const camera = cameraAt([-200, -5, 50], at, { width: 96, height: 64, fovXDegrees: 60, near: 0.01 });
    renderer.render({ gaussians: scene, camera, target, detail: 4, splatBudget: 150_000 });
    await device.queue.onSubmittedWorkDone();
  };
  // Capacity is checked every 16 frames.
  for (let frame = 0; frame < 18; frame++) await look([-300, -5, 50]);
  const away = await renderer.stats();
  await look([50, 0, 50]);
  const towards = await renderer.stats();
  console.log(`${away.visible} splats visible, then ${towards.visible}; ${towards.overflow} left out`);
  assert.ok(scene.count > 1.5e5 && away.visible === 0 && towards.visible > 100);
  assert.equal(towards.overflow + towards.pairOverflow, 0);
  [renderer, scene, target].forEach((owner) => owner.destroy());
});

test('with any requests, arrivals and failures, the ancestors of a page are resident, and no page is there twice', () => {
  const random = randomSource(5);
  const list = listPages(folder.manifest);
  const residency = new Residency(list, 5);
  residency.begin(0);
  residency.settle(0);
  const coming: number[] = [];
  for (let step = 0; step < 3000; step++) {
    residency.note(Float32Array.from({ length: list.count }, () => (random() < 0.5 ? 0 : 10 * random())));
    for (let page = residency.nextMissing(); page !== NONE && coming.length < 3; page = residency.nextMissing()) {
      if (residency.begin(page)) coming.push(page);
    }
    const [page] = coming.splice(Math.floor(random() * coming.length), 1);
    if (page !== undefined && random() < 0.2) residency.cancel(page);
    else if (page !== undefined) residency.settle(page);
    const residents = [...residency.slots.pageIn].filter((resident) => resident !== NONE);
    assert.equal(new Set(residents).size, residents.length);
    assert.ok(residents.includes(0));
    for (const resident of residents) {
      assert.equal(residency.slots.pageIn[residency.slots.slotOf[resident]], resident);
      if (resident !== 0) assert.ok(residency.isResident(list.parent[resident]), `page ${resident} hangs in the air`);
    }
  }
});

test('a page that does not arrive is reported, and its parent stays visible', async () => {
  const errors: unknown[] = [];
  const device = await anyDevice();
  const scene = await StreamedGaussians.open(device, folder.manifest, {
    fetchPage: (file) =>
      file === 'pages/scene-00000.bin' ? folder.fetchPage(file) : Promise.reject(new Error(`${file}: 404`)),
    onError: (error) => errors.push(error),
  });
  const renderer = new Renderer(device, options);
  await drawUntilCalm(scene, renderer, viewFrom(14), 0.2);
  const image = await readFrame(device, renderer, { gaussians: scene, camera: viewFrom(14), detail: 0.2 });
  assert.ok(errors.length > 0 && scene.progress.resident === 1);
  assert.ok(image.some((value) => value > 0.1));
  renderer.destroy();
  scene.destroy();
});

test('a page of the wrong length, and a manifest with anything wrong in it, are refused with a name', async () => {
  const device = await anyDevice();
  const short = (): Promise<ArrayBuffer> => Promise.resolve(new ArrayBuffer(8));
  await assert.rejects(StreamedGaussians.open(device, folder.manifest, { fetchPage: short }), {
    code: 'decode/truncated',
  });
  const tiny = { fetchPage: folder.fetchPage, memoryBudget: 1000 };
  await assert.rejects(StreamedGaussians.open(device, folder.manifest, tiny), { code: 'out-of-memory/budget' });
  const text = JSON.stringify(folder.manifest);
  assert.deepEqual(checkManifest(JSON.parse(text), 'detail.json'), JSON.parse(text));
  const faults: Record<string, unknown>[] = [
    ...[
      { format: 'gltf' },
      { version: 2 },
      { shDegree: 4 },
      { origin: [1, 2] },
      { trees: [] },
      { instances: [] },
      { bounds: {} },
    ],
    { trees: [{ pages: [{ file: 'a', chunks: 21, upper: 4 }] }] },
    { trees: [{ pages: [{ file: 'a', chunks: 1, upper: 1, parent: [0, 0] }] }] },
    { trees: [{ pages: [{ file: 'a', chunks: 1, upper: 2 }] }] },
    { instances: [{ tree: 1, translate: [0, 0, 0] }] },
    {
      instances: [
        { tree: 0, translate: [0, 0, 0] },
        { tree: 0, translate: [0, 0, 0], parent: [999, 0] },
      ],
    },
  ];
  for (const fault of faults) {
    assert.throws(
      () => checkManifest({ ...JSON.parse(text), ...fault }, 'detail.json'),
      /detail\.json/,
      JSON.stringify(fault),
    );
  }
  assert.throws(() => checkManifest(null, 'detail.json'), { code: 'decode/unsupported' });
});

test('an opening that is given up ends its fetch and holds no memory, and a time that is none is refused', async () => {
  const device = await anyDevice();
  const before = MemoryLedger.of(device).entries.length;
  const closing = new AbortController();
  let isFetching = false;
  let isAborted = false;
  // A server that takes the request and never answers.
  const fetchPage = (_: string, signal: AbortSignal): Promise<ArrayBuffer> =>
    new Promise((_, reject) => {
      isFetching = true;
      signal.addEventListener('abort', () => {
        isAborted = true;
        reject(new Error('aborted'));
      });
    });
  const opening = StreamedGaussians.open(device, folder.manifest, { fetchPage, signal: closing.signal });
  while (!isFetching) await pause(1);
  assert.equal(MemoryLedger.of(device).entries.length, before + 1);
  const reason = new Error('the element is gone');
  closing.abort(reason);
  await assert.rejects(Promise.race([opening, pause(2000).then(() => 'still open')]), reason);
  assert.ok(isAborted);
  assert.equal(MemoryLedger.of(device).entries.length, before);
  for (const arrivalMs of [-1, NaN, Infinity]) {
    const open = StreamedGaussians.open(device, folder.manifest, { fetchPage: folder.fetchPage, arrivalMs });
    await assert.rejects(open, { code: 'argument/value', message: /arrivalMs/ });
  }
  assert.equal(MemoryLedger.of(device).entries.length, before);
});

test('a manifest in which two pages are below one chunk, a file has two lengths, or instances make more pages than there may be is refused', () => {
  const root = { file: 'a', chunks: 5, upper: 1 };
  const leaf = (file: string, parent: readonly [number, number], chunks = 4): object => ({
    ...{ file, chunks, upper: chunks, parent },
  });
  const check = (pages: readonly object[], instances: readonly object[] = []): unknown => {
    const first = { tree: 0, translate: [0, 0, 0] };
    return checkManifest({ ...folder.manifest, trees: [{ pages }], instances: [first, ...instances] }, 'detail.json');
  };
  const copy = (parent: readonly [number, number]): object => ({ tree: 0, translate: [1, 0, 0], parent });
  check([root, leaf('b', [0, 1]), leaf('c', [0, 2])], [copy([0, 3]), copy([0, 4]), copy([1, 0])]);
  const refused = { code: 'decode/header', message: /without another child/ };
  assert.throws(() => check([root, leaf('b', [0, 1]), leaf('c', [0, 1])]), refused, 'two files');
  assert.throws(() => check([root, leaf('b', [0, 0])]), refused, 'a file, and a page of the same file');
  assert.throws(() => check([root, leaf('b', [0, 1])], [copy([0, 1])]), refused, 'a file and a copy');
  assert.throws(() => check([root], [copy([0, 2]), copy([0, 2])]), refused, 'two copies');
  assert.throws(() => check([root, leaf('b', [0, 1]), leaf('b', [0, 2], 3)]), {
    code: 'decode/header',
    message: /chunks of b/,
  });
  // 2 MB of text, 10 GB of memory.
  const pages = Array.from({ length: 10_000 }, (_, p) =>
    p === 0 ? root : leaf(`${p}`, p < 5 ? [0, p] : [(p - 1) >> 2, (p - 1) & 3]),
  );
  const places = Array.from({ length: 10_000 }, (_, k) => copy([5000 + (k >> 2), k & 3]));
  assert.throws(() => check(pages, places), { code: 'decode/header', message: /at most 4194304 pages/ });
  // A load that may take memory for fewer.
  const refusal = { code: 'out-of-memory/budget', message: /at most 3 pages in a file of this size, found \d+/ };
  assert.throws(() => checkManifest(folder.manifest, 'detail.json', 3), refusal);
});

/** Largest change of a resting camera's image from one frame to the next, in dB, while pages load. */
async function largestChange(arrivalMs: number): Promise<{ decibels: number; frames: number; pages: number }> {
  const device = await anyDevice();
  const fetchPage = folder.fetchPage;
  const scene = await StreamedGaussians.open(device, folder.manifest, { fetchPage, arrivalMs });
  const renderer = new Renderer(device, options);
  const request = { gaussians: scene, camera: viewFrom(9), detail: 0.5 };
  let [min, frames, calm]: number[] = [Infinity, 1, 0];
  let last = await readFrame(device, renderer, request);
  for (; calm < 8 && frames < 400; frames++) {
    await pause(1);
    const { resident } = scene.progress;
    const image = await readFrame(device, renderer, request);
    min = Math.min(min, psnr(last, image, { channels: 4 }));
    last = image;
    calm = scene.progress.resident === resident && scene.progress.coming === 0 ? calm + 1 : 0;
  }
  const pages = scene.progress.resident;
  renderer.destroy();
  scene.destroy();
  return { decibels: min, frames, pages };
}

test('arriving pages fade in: consecutive frames have a PSNR above 40 dB; without the fade they pop', async () => {
  const [faded, popping] = [await largestChange(1), await largestChange(0)];
  console.log(`${faded.pages} pages, largest change: ${JSON.stringify(faded)}; at once ${JSON.stringify(popping)}`);
  assert.ok(faded.pages > 3 && faded.pages === popping.pages);
  assert.ok(faded.decibels >= 40 && popping.decibels < faded.decibels - 10);
});

after(endNodeDevice);
