/** Scenes whose files have levels of their own (streamed SOG), box by box: with any arrivals, failures and evictions, every box is covered exactly once. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { setTimeout as pause } from 'node:timers/promises';
import { GaussianSplatError, keepUsable, type Camera } from '@gaussian-splat/core';
import { readScene, SogFiles } from '@gaussian-splat/formats';
import { GaussianBuffers, StreamedGaussians, type PageSource } from '@gaussian-splat/renderer';
import { levelSource, packLevelPage, packLevelRuns } from '@gaussian-splat/renderer/tools';
import { constants, NONE, SLOT_CHUNKS } from '@gaussian-splat/renderer/stages';
import { needsSharedData, sharedFile } from '../support/data.js';
import { checkBoxes } from '../support/covered-boxes.js';
import { randomSource } from '../support/gpu.js';
import { heaps } from '../support/scenes/heaps.js';
import { lodFolder, openLod, pick, type FetchPart } from '../support/lod-folder.js';
import { psnr } from '../support/metrics.js';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { Renderer } from '../support/renderer.js';

const { CULL_GROUP } = constants;
/** Pixels that flights allow. */
const DETAIL = 0.1;
const options = { threads: 'serial', sort: 'serial' } as const;
const viewFrom = (distance: number, angle = 0.4, x = 0): Camera =>
  cameraAt([x + distance * Math.cos(angle), -0.5 * distance, distance * Math.sin(angle)], [x, 0, 0], {
    ...{ width: 96, height: 64, fovXDegrees: 60, near: 0.01 },
  });

/** Bytes of a slot, from a page's contents in docs/lod-format.md. */
function slotBytes({ scene }: PageSource): number {
  const words = { int8: [2, 4, 8, 14], float16: [2, 6, 14, 24] }[scene.shPrecision][scene.shDegree];
  return 4 * SLOT_CHUNKS * (8 + 12 + 8 + CULL_GROUP * (4 + words));
}

test('pages of levels: slots by what the index says, errors that grow, one sphere for a box', () => {
  const { levels } = heaps(4);
  const source = levelSource(levels, () => assert.fail('nothing is fetched'));
  const { list } = source;
  assert.equal(list.count, 1 + 3 + 2 + 3 + 2);
  assert.equal(levels.firstChunks[0], 1, 'one chunk of nothing for the box without a coarsest level');
  levels.pages.forEach(({ box, level, count, sphere, error }, p) => {
    assert.equal(list.slots[p + 1], Math.ceil(Math.ceil(count / CULL_GROUP) / SLOT_CHUNKS));
    assert.equal(list.parent[p + 1], level === 1 ? 0 : p);
    const next = levels.pages[p + 1];
    if (next?.box === box) assert.ok(error > next.error && sphere === next.sphere);
    else assert.equal(error, 0);
    const center = [5 * box, 0, 0];
    assert.ok(sphere.slice(0, 3).every((x, axis) => Math.abs(x - center[axis]) < 0.3));
    assert.ok(sphere[3] > 1.7 && sphere[3] < 3.5, `${sphere[3]}`);
  });
  assert.ok(levels.scene.bounds.max[0] < 18, 'the sky says nothing of where the scene is');
  assert.equal(list.children.filter((page) => page !== NONE).length > 0, true);
});

test('in a flight over a small pool, with levels that come late, in any order, or not at all, every box is covered exactly once in every frame', async () => {
  const device = await anyDevice();
  const random = randomSource(12);
  const { levels, clouds } = heaps(5);
  let failures = 0;
  const source = levelSource(levels, async (page, signal) => {
    await pause(12 * random());
    signal.throwIfAborted();
    if (random() < 0.1) throw new Error(`level ${page.level} of box ${page.box}: 404`);
    return packLevelPage(
      keepUsable({ ...pick(clouds[page.box][page.level], [...Array(page.count).keys()]) }),
      page,
      levels.scene,
    );
  });
  const slots = source.list.slots[0] + 25;
  const total = source.list.slots.reduce((sum, own) => sum + own, 0);
  assert.ok(total > 2 * slots, `${total} slots in all, ${slots} in the pool`);
  const scene = await StreamedGaussians.openSource(device, source, {
    ...{ memoryBudget: slots * slotBytes(source), arrivalMs: 60, onError: () => failures++ },
  });
  assert.equal(scene.pagesInSlots.length, slots);
  const renderer = new Renderer(device, options);
  const target = device.createTexture({ size: [96, 64], format: 'rgba8unorm', usage: 0x10 });
  const seen = new Set<number>();
  let [left, before] = [0, new Set<number>()];
  for (let frame = 0; frame < 90; frame++) {
    const camera = viewFrom(1.5 + 9 * Math.abs(Math.sin(frame / 16)), frame / 20, 5 * (Math.floor(frame / 15) % 5));
    renderer.render({ gaussians: scene, camera, target, detail: DETAIL });
    await device.queue.onSubmittedWorkDone();
    await pause(6);
    const { drawn, whole } = await checkBoxes(levels, source, scene, { camera, allowed: DETAIL });
    for (const page of drawn) seen.add(page);
    if ([...before].some((page) => !whole.has(page))) left++;
    before = whole;
  }
  console.log(
    `${seen.size} of ${levels.pages.length} pages drawn at some time, ${left} frames in which some left, ${failures} failures`,
  );
  assert.ok(seen.size > 6 && left > 2 && failures > 0);
  assert.ok(
    [...seen].some((page) => source.list.slots[page] > 1),
    'pages of several slots',
  );
  [renderer, scene, target].forEach((owner) => owner.destroy());
});

test('a streamed scene with all pages is drawn without an error as the scene that was loaded completely', async () => {
  const device = await anyDevice();
  const folder = lodFolder(pebbles(12_000), {
    levels: 4,
    boxes: 3,
    environment: pick(pebbles(300, 4), [...Array(300).keys()], 2),
  });
  const openFile = (path: string): Promise<Uint8Array> => Promise.resolve(folder.files.get(path)!);
  const log: string[] = [];
  const { scene } = await openLod(device, folder.index, (path) => {
    log.push(path);
    return openFile(path);
  });
  assert.ok(
    log.every((path) => /^(3_0|env)\//.test(path)),
    'the coarsest first',
  );
  const cloud = await readScene(folder.index, { name: 'lod-meta.json', openFile, level: 'all' });
  const whole = await GaussianBuffers.upload(device, packLevelRuns(cloud));
  const [streaming, loaded] = [new Renderer(device, options), new Renderer(device, options)];
  for (const camera of [viewFrom(14), viewFrom(5, 2)]) {
    await drawUntilCalm(scene, streaming, camera, 0);
    const expected = await readFrame(device, loaded, { gaussians: whole, camera });
    const found = await readFrame(device, streaming, { gaussians: scene, camera });
    const close = psnr(expected, found, { channels: 4 });
    console.log(`${close.toFixed(1)} dB with ${scene.progress.resident} of ${scene.progress.total} pages`);
    assert.ok(close > 60, `${close} dB`);
  }
  assert.equal(scene.progress.resident, scene.progress.total);
  assert.equal(log.filter((path) => path.endsWith('meta.json')).length, 5, 'each file once');
  [streaming, loaded, scene, whole].forEach((owner) => owner.destroy());
});

test('a missing file, and a run beyond its file, are reported by name, and the coarser splats in their place stay', async () => {
  const device = await anyDevice();
  const folder = lodFolder(pebbles(8_000), { levels: 3, boxes: 2 });
  const text = new TextDecoder().decode(folder.index);
  const index = JSON.parse(text) as { tree: { children: { lods: Record<string, { count: number }> }[] } };
  index.tree.children[1].lods[1].count += 1000;
  const fetch: FetchPart = (path) => {
    const missing = new GaussianSplatError('network/status', {
      where: path,
      expected: 'a file',
      found: '404',
      remedy: 'upload it',
    });
    return path.startsWith('0_0') ? Promise.reject(missing) : Promise.resolve(folder.files.get(path)!);
  };
  const errors: GaussianSplatError[] = [];
  const { scene } = await openLod(device, new TextEncoder().encode(JSON.stringify(index)), fetch, {
    onError: (error) => errors.push(error as GaussianSplatError),
  });
  const renderer = new Renderer(device, options);
  await drawUntilCalm(scene, renderer, viewFrom(8), 0);
  // The first box has its middle level, the second the coarsest.
  assert.equal(scene.progress.resident, 2);
  assert.deepEqual(new Set(errors.map(({ code }) => code)), new Set(['network/status', 'decode/corrupt']));
  assert.ok(errors.some(({ where }) => where.includes('lod-meta.json, 1_0/meta.json')));
  const image = await readFrame(device, renderer, { gaussians: scene, camera: viewFrom(8) });
  assert.ok(image.some((value) => value > 0.1));
  [renderer, scene].forEach((owner) => owner.destroy());
});

test('a pool without room for the coarsest levels is refused, and so are pages of another size', async () => {
  const device = await anyDevice();
  const { levels, clouds } = heaps(2);
  const source = levelSource(levels, () => Promise.resolve(new Uint32Array(5)));
  await assert.rejects(StreamedGaussians.openSource(device, source, { memoryBudget: 1000 }), {
    code: 'out-of-memory/budget',
  });
  await assert.rejects(source.fetch(1, new AbortController().signal), { code: 'decode/truncated' });
  const none = { ...clouds[1][2], opacities: clouds[1][2].opacities.map(() => NaN) };
  assert.throws(() => packLevelPage(none, levels.pages[3], levels.scene), { code: 'argument/cloud' });
});

test(
  'a real streamed scene, from a small pool without a hole, and from one with room for all as loaded whole',
  { skip: needsSharedData },
  async () => {
    const folder = 'scenes/playbot-streamed/';
    const device = await anyDevice();
    const fetch: FetchPart = async (path) => sharedFile(folder + path);
    // The three finest are left out, which only take time here.
    let bytes = 0;
    const counting: FetchPart = async (path) => {
      const file = sharedFile(folder + path);
      bytes += file.length;
      return file;
    };
    const opened = await openLod(device, sharedFile(`${folder}lod-meta.json`), counting);
    console.log(`${bytes} bytes before the first frame of ${opened.levels.scene.splats} splats`);
    assert.ok(bytes < 70_000 && opened.levels.scene.splats === 500_000);
    opened.scene.destroy();
    const text = new TextDecoder().decode(sharedFile(`${folder}lod-meta.json`));
    const index = new TextEncoder().encode(text.replace(/"[012]":\{"file":\d+,"offset":\d+,"count":\d+\},?/g, ''));
    const renderer = new Renderer(device, options);
    const files = new SogFiles();
    const small = await openLod(
      ...([device, index, fetch] as const),
      (source) => ({ memoryBudget: 24 * slotBytes(source), arrivalMs: 30 }),
      files,
    );
    assert.deepEqual([...small.source.list.slots], [2, 2, 5, 16, 2, 5, 16]);
    const target = device.createTexture({ size: [96, 64], format: 'rgba8unorm', usage: 0x10 });
    let max = 0;
    for (let frame = 0; frame < 40; frame++) {
      const camera = viewFrom(0.8 + 3 * Math.abs(Math.sin(frame / 12)), frame / 9);
      renderer.render({ gaussians: small.scene, camera, target, detail: DETAIL });
      await device.queue.onSubmittedWorkDone();
      await pause(2);
      const { whole } = await checkBoxes(small.levels, small.source, small.scene, { camera, allowed: DETAIL });
      max = Math.max(max, whole.size);
    }
    assert.ok(max >= 2, `${max} pages`);
    assert.ok(small.scene.progress.resident <= 6);
    const large = await openLod(device, index, fetch, {}, files);
    const camera = viewFrom(2);
    await drawUntilCalm(large.scene, renderer, camera, 0);
    assert.equal(large.scene.progress.resident, large.scene.progress.total);
    const cloud = await readScene(index, {
      ...{ name: 'lod-meta.json', level: 'all' },
      openFile: async (path) => sharedFile(folder + path),
    });
    const whole = await GaussianBuffers.upload(device, packLevelRuns(cloud));
    const expected = await readFrame(device, renderer, { gaussians: whole, camera });
    const found = await readFrame(device, renderer, { gaussians: large.scene, camera });
    const close = psnr(expected, found, { channels: 4 });
    console.log(`${close.toFixed(1)} dB, ${cloud.count} splats at all levels`);
    assert.ok(close > 60, `${close} dB`);
    [renderer, small.scene, large.scene, whole, target].forEach((owner) => owner.destroy());
  },
);

after(endNodeDevice);
