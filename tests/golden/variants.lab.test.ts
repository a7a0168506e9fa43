/** Variants of the stages draw one image; those that a device is served best with are found by measuring. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { setTimeout as delay } from 'node:timers/promises';
import { autotune, GaussianBuffers, packGaussians, pickInitialVariants, type Variants } from '@gaussian-splat/renderer';
import { passesSelfTest, mortonOrder, packSpheres, ROUNDS, sphereCloud } from '@gaussian-splat/renderer/stages';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { onlyInFull } from '../support/extent.js';
import { isSwiftShader } from '../support/limit.js';
import { endNodeDevice, nodeDevice } from '../support/node-device.js';
import { room } from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

test('serial and parallel stages draw the same bytes, moving and turning', async () => {
  const device = await nodeDevice();
  const { cloud, cameras } = room();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderers = (['parallel', 'serial'] as const).map((threads) => new Renderer(device, { threads }));
  for (const camera of [...cameras, cameras[0]]) {
    const [parallel, serial] = [
      await capture(device, renderers[0], { gaussians, camera }),
      await capture(device, renderers[1], { gaussians, camera }),
    ];
    assert.deepEqual(Buffer.from(parallel.buffer), Buffer.from(serial.buffer));
  }
  assert.ok((await renderers[1].stats()).visible > 1000);
});

test('every variant passes the self-test, and a wrong rule does not', async () => {
  const device = await nodeDevice();
  for (const threads of ['parallel', 'serial'] as const) {
    for (const rasterizer of ['quads', 'tiles'] as const) {
      assert.ok(await passesSelfTest(device, { threads, rasterizer }), `${threads} ${rasterizer}`);
    }
  }
  assert.equal(await passesSelfTest(device, { shDegree: 0 }), false, 'no view-dependent color');
  assert.equal(await passesSelfTest(device, { resolutionScale: 0.5 }), false, 'half the pixels');
});

test('the spheres that variants are judged by are packed as files are', () => {
  for (const [count, size] of [
    [64, 1],
    [4_000, 0.46],
  ]) {
    const cloud = sphereCloud(count, size);
    const order = mortonOrder(
      cloud.positions,
      Uint32Array.from({ length: count }, (_, i) => i),
    );
    assert.deepEqual(packSpheres(cloud, 'float16', order), packGaussians(cloud, { sh: 'float16' }));
    assert.deepEqual(packSpheres(cloud, 'int8', order), packGaussians(cloud));
  }
});

/** Spheres that are packed within one task of the main thread: 64,000 took a desktop CPU 250 ms. */
const AT_ONCE = 4_096;

test('the scenes that variants are timed with are copies of a few spheres', () => {
  for (const { scene } of ROUNDS) {
    const { count, geometry, sh, chunks } = scene();
    const copies = count / AT_ONCE;
    assert.ok(Number.isInteger(copies));
    assert.equal(geometry.length, copies * packGaussians(sphereCloud(AT_ONCE, 1)).geometry.length);
    for (const words of [geometry, sh, chunks]) {
      const part = words.length / copies;
      for (let k = 1; k < copies; k++)
        assert.deepEqual(words.subarray(k * part, (k + 1) * part), words.subarray(0, part));
    }
  }
});

test('autotuning runs once, is stored for the adapter, and runs again after a damaged store', async () => {
  const adapter = await requestNodeAdapter();
  const entries = new Map<string, string>();
  const store = storeOf(entries);
  const first = await adapter.requestDevice();
  performance.clearMeasures();
  const chosen = await autotune(first, { store, pause: () => delay(20) });
  await assertSuits(first, chosen);
  const [search] = performance.getEntriesByName('gaussian-splat.search') as PerformanceMeasure[];
  const { paused } = search.detail as { paused: number };
  assert.ok(paused >= 19 && search.duration > paused, `${search.duration} ms, of which ${paused} of pauses`);
  assert.equal(entries.size, 1);
  const [key] = entries.keys();
  // Another that is right, as a visit may have left it.
  const other: Variants =
    chosen.threads === 'serial'
      ? { ...chosen, threads: 'parallel' }
      : { ...chosen, rasterizer: chosen.rasterizer === 'tiles' ? 'quads' : 'tiles' };
  entries.set(key, JSON.stringify(other));
  assert.deepEqual(await autotune(await newDevice(), { store }), other);
  assert.equal(performance.getEntriesByName('gaussian-splat.search').length, 1, 'what is kept is not searched for');
  for (const damage of ['{', 'null', '{"rasterizer":"crayons"}']) {
    entries.set(key, damage);
    const device = await newDevice();
    const again = await autotune(device, { store });
    await assertSuits(device, again);
    assert.deepEqual(JSON.parse(entries.get(key)!), again, damage);
    await autotune(device);
    const renderer = new Renderer(device);
    assert.equal(renderer.resolvedSettings.threads, again.threads);
    assert.equal(renderer.resolvedSettings.rasterizer, again.rasterizer);
    renderer.destroy();
    device.destroy();
  }
});

test('a device that is lost while variants are tried leaves the choice for its adapter as it was', async () => {
  const entries = new Map<string, string>();
  const store = storeOf(entries);
  const chosen = await autotune(await newDevice(), { store });
  const [[key, kept]] = entries;
  for (const [moment, isKnown, milliseconds] of [
    ['before the first trial', true, 0],
    ['while the kept choice is checked', true, 20],
    ['while all are tried', false, 100],
  ] as const) {
    entries.clear();
    if (isKnown) entries.set(key, kept);
    const device = await deviceLikeAny();
    const choosing = autotune(device, { store });
    if (milliseconds > 0) await new Promise((resolve) => setTimeout(resolve, milliseconds));
    device.destroy();
    await choosing;
    assert.deepEqual([...entries.values()], isKnown ? [kept] : [], moment);
  }
  // Repeated trials may end differently on a busy GPU; the stored choice counts.
  entries.set(key, kept);
  assert.deepEqual(await autotune(await newDevice(), { store }), chosen);
});

/** A device whose adapter does not report that it is software. */
async function deviceLikeAny(): Promise<GPUDevice> {
  const device = await newDevice();
  Object.defineProperty(device, 'adapterInfo', { value: { ...chosenBy(device), isFallbackAdapter: false } });
  return device;
}

function storeOf(entries: Map<string, string>) {
  return {
    getItem: (key: string) => entries.get(key) ?? null,
    setItem: (key: string, value: string) => void entries.set(key, value),
  };
}

test('a first frame is drawn with likely variants, if they are correct and fast; the best ones are searched in pauses', async () => {
  const entries = new Map<string, string>();
  const store = storeOf(entries);
  const device = await deviceLikeAny();
  let pipelines = 0;
  const make = device.createComputePipeline.bind(device);
  device.createComputePipeline = (descriptor) => (pipelines++, make(descriptor));
  const begun = await pickInitialVariants(device, { store, maxFrameMs: Infinity });
  assert.deepEqual(begun, { rasterizer: 'tiles', accumulation: 'rgba16float', threads: 'parallel' });
  assert.equal(new Renderer(device).resolvedSettings.rasterizer, 'tiles');
  assert.equal(entries.size, 0, 'nothing that was not measured is kept');
  const atFirst = pipelines;
  const pauses: (() => void)[] = [];
  const choosing = autotune(device, { store, pause: () => new Promise((resolve) => pauses.push(resolve)) });
  await new Promise((resolve) => setTimeout(resolve, 200));
  assert.equal(pauses.length, 1);
  assert.equal(pipelines, atFirst, 'nothing continues before the pause');
  const letGo = setInterval(() => pauses.pop()?.(), 1);
  const chosen = await choosing;
  clearInterval(letGo);
  await assertSuits(device, chosen);
  assert.deepEqual(JSON.parse([...entries.values()][0]), chosen);
  assert.equal(new Renderer(device).resolvedSettings.rasterizer, chosen.rasterizer);
  assert.ok(pipelines > atFirst);
  device.destroy();

  const later = await deviceLikeAny();
  const pause = () => assert.fail('nothing is searched');
  assert.deepEqual(
    await pickInitialVariants(later, { store, maxFrameMs: 0, pause }),
    chosen,
    'what an earlier visit found',
  );
  assert.deepEqual(await autotune(later, { store, pause }), chosen);
  later.destroy();
});

test('what is likely is not drawn with where it is slow', { skip: onlyInFull }, async () => {
  const device = await deviceLikeAny();
  const isLookedFor = new Promise<void>((resolve) => {
    const pause = () => new Promise<void>(() => resolve());
    void pickInitialVariants(device, { store: null, maxFrameMs: 0, pause });
  });
  await isLookedFor;
  assert.equal(new Renderer(device).resolvedSettings.rasterizer, 'quads', 'what works everywhere, until that is found');
  device.destroy();
});

test('nor if the adapter is a software adapter', async (t) => {
  const processor = await newDevice();
  if (!processor.adapterInfo.isFallbackAdapter) return t.skip('this adapter is a GPU');
  const entries = new Map<string, string>();
  const begun = await pickInitialVariants(processor, { store: storeOf(entries), maxFrameMs: Infinity });
  await assertSuits(processor, begun);
  assert.deepEqual(JSON.parse([...entries.values()][0]), begun);
  processor.destroy();
});

/** The key of a stored choice. */
function chosenBy({ adapterInfo }: GPUDevice): Partial<GPUAdapterInfo> {
  const { vendor, architecture, device, description } = adapterInfo;
  return { vendor, architecture, device, description };
}

const newDevice = async (): Promise<GPUDevice> => (await requestNodeAdapter()).requestDevice();

/** On SwiftShader one choice is right. Elsewhere measuring decides, and may decide differently the next time, but never for variants that draw another image. */
async function assertSuits(device: GPUDevice, chosen: Variants): Promise<void> {
  assert.ok(await passesSelfTest(device, chosen), JSON.stringify(chosen));
  if (!isSwiftShader(device)) return;
  assert.equal(chosen.rasterizer, 'quads', 'tiles are no choice for SwiftShader');
  assert.equal(chosen.threads, 'serial', 'nor are barriers');
}

after(endNodeDevice);
