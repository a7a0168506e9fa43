/** Variants of the stages draw one image; those that a device is served best with are found by measuring. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import {
  capture,
  chooseVariants,
  GaussianBuffers,
  packGaussians,
  Renderer,
  type Variants,
} from '@gaussian-splat/renderer';
import { givesKnownAnswer, packSpheres, sphereCloud } from '@gaussian-splat/renderer/stages';
import { requestNodeAdapter } from '../../scripts/lib/node-gpu.mjs';
import { isSwiftShader } from '../support/limit.js';
import { endNodeDevice, nodeDevice } from '../support/node-device.js';
import { room } from '../support/scenes.js';

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
  assert.ok((await renderers[1].readStatistics()).visible > 1000);
});

test('every variant gives the known answer, and a wrong rule does not', async () => {
  const device = await nodeDevice();
  for (const threads of ['parallel', 'serial'] as const) {
    for (const rasterizer of ['quads', 'tiles'] as const) {
      assert.ok(await givesKnownAnswer(device, { threads, rasterizer }), `${threads} ${rasterizer}`);
    }
  }
  assert.equal(await givesKnownAnswer(device, { alphaMin: 0.05 }), false, 'an alpha threshold of 0.05');
  assert.equal(await givesKnownAnswer(device, { shDegree: 0 }), false, 'no view-dependent colour');
  assert.equal(await givesKnownAnswer(device, { resolutionScale: 0.5 }), false, 'half the pixels');
});

test('the spheres that variants are judged by are packed as files are', () => {
  for (const [count, size] of [
    [64, 1],
    [4_000, 0.46],
  ]) {
    const cloud = sphereCloud(count, size);
    assert.deepEqual(packSpheres(cloud, 'float16'), packGaussians(cloud, { sh: 'float16' }));
    assert.deepEqual(packSpheres(cloud, 'int8'), packGaussians(cloud));
  }
});

test('the choice is made once, kept for the adapter, and made anew from a damaged store', async () => {
  const adapter = await requestNodeAdapter();
  const entries = new Map<string, string>();
  const store = {
    getItem: (key: string) => entries.get(key) ?? null,
    setItem: (key: string, value: string) => void entries.set(key, value),
  };
  const first = await adapter.requestDevice();
  const chosen = await chooseVariants(first, { store });
  await assertSuits(first, chosen);
  assert.equal(entries.size, 1);
  const [key] = entries.keys();
  // Another that is right, as a visit may have left it.
  const other: Variants =
    chosen.threads === 'serial'
      ? { ...chosen, threads: 'parallel' }
      : { ...chosen, rasterizer: chosen.rasterizer === 'tiles' ? 'quads' : 'tiles' };
  entries.set(key, JSON.stringify(other));
  assert.deepEqual(await chooseVariants(await newDevice(), { store }), other);
  for (const damage of ['{', 'null', '{"rasterizer":"crayons"}']) {
    entries.set(key, damage);
    const device = await newDevice();
    const anew = await chooseVariants(device, { store });
    await assertSuits(device, anew);
    assert.deepEqual(JSON.parse(entries.get(key)!), anew, damage);
    const renderer = await Renderer.create(device);
    assert.equal(renderer.levers.threads, anew.threads);
    assert.equal(renderer.levers.rasterizer, anew.rasterizer);
    renderer.destroy();
    device.destroy();
  }
});

test('a device that is lost while variants are tried leaves the choice for its adapter as it was', async () => {
  const entries = new Map<string, string>();
  const store = {
    getItem: (key: string) => entries.get(key) ?? null,
    setItem: (key: string, value: string) => void entries.set(key, value),
  };
  const chosen = await chooseVariants(await newDevice(), { store });
  const [[key, kept]] = entries;
  for (const [moment, isKnown, milliseconds] of [
    ['before the first trial', true, 0],
    ['while the kept choice is checked', true, 20],
    ['while all are tried', false, 100],
  ] as const) {
    entries.clear();
    if (isKnown) entries.set(key, kept);
    const device = await newDevice();
    // All ways to sort are tried where the adapter does not call itself a fallback.
    Object.defineProperty(device, 'adapterInfo', { value: { ...chosenBy(device), isFallbackAdapter: false } });
    const choosing = chooseVariants(device, { store });
    if (milliseconds > 0) await new Promise((resolve) => setTimeout(resolve, milliseconds));
    device.destroy();
    await choosing;
    assert.deepEqual([...entries.values()], isKnown ? [kept] : [], moment);
  }
  // Trials that are made anew may end otherwise on a GPU that has other things to do; what was kept counts.
  entries.set(key, kept);
  assert.deepEqual(await chooseVariants(await newDevice(), { store }), chosen);
});

/** What a choice is kept under. */
function chosenBy({ adapterInfo }: GPUDevice): Partial<GPUAdapterInfo> {
  const { vendor, architecture, device, description } = adapterInfo;
  return { vendor, architecture, device, description };
}

const newDevice = async (): Promise<GPUDevice> => (await requestNodeAdapter()).requestDevice();

/** On SwiftShader one choice is right. Elsewhere measuring decides, and may decide differently the next time, but never for what draws another picture. */
async function assertSuits(device: GPUDevice, chosen: Variants): Promise<void> {
  assert.ok(await givesKnownAnswer(device, chosen), JSON.stringify(chosen));
  if (!isSwiftShader(device)) return;
  assert.equal(chosen.rasterizer, 'quads', 'tiles are no choice for SwiftShader');
  assert.equal(chosen.threads, 'serial', 'nor are barriers');
}

after(endNodeDevice);
