/**
 * S23. Leaks.
 *
 * Who fails: Spark #286, #292, #318 and #408, SuperSplat #409, Cesium #13483: memory grows with every scene that is loaded and removed.
 *
 * Recipe: asked for 500 cycles of load and unload, and two hours. Run so; the two hours are `npm run lab -- soak`.
 *
 * Passes: after 500 cycles of load, draw, resize, turn and destroy, with both rasterizers and with generators, exactly the buffers live that lived after the first. The heap of the page and two
 * hours on end are `npm run lab -- soak`'s.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { DynamicGaussians, GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { writeTensors } from '../support/generator-tensors.js';
import { offCenter } from '../support/scenes.js';
import { deviceWith } from './support/devices.js';
import { watchMemory } from './support/ledger.js';
import { resized, yawed, THREADS } from './support/images.js';
import { holds, sized } from './support/row.js';
import { capture, Renderer } from '../support/renderer.js';

const SPEC = {
  layout: 'packed',
  shape: 'scale',
  color: 'rgb',
  opacity: 'linear',
  quaternionOrder: 'wxyz',
  dtype: 'float32',
} as const;
const { cloud, cameras } = offCenter();
const packed = packGaussians(cloud);
const written = writeTensors(cloud, SPEC);

async function cycle(device: GPUDevice, i: number): Promise<number> {
  const renderer = new Renderer(device, {
    threads: THREADS,
    rasterizer: i % 8 === 0 ? sized('quads', 'tiles') : 'quads',
  });
  const scene =
    i % 3 === 2 ? await DynamicGaussians.create(device, written.layout) : await GaussianBuffers.upload(device, packed);
  const tensors: Record<string, GPUBuffer> = {};
  if (scene instanceof DynamicGaussians) {
    for (const [name, words] of Object.entries(written.tensors)) {
      tensors[name] = device.createBuffer({ size: words.byteLength, usage: 0x80 | 0x8 });
      device.queue.writeBuffer(tensors[name], 0, words as Uint32Array<ArrayBuffer>);
    }
    scene.ingest(tensors, cloud.count);
  }
  for (const width of [20 + (i % 50), 70 - (i % 50)]) {
    const camera = yawed(resized(cameras[0], width), 0.01 * i);
    await capture(device, renderer, { gaussians: scene, camera });
  }
  const held = renderer.byteLength + scene.byteLength;
  renderer.destroy();
  scene.destroy();
  for (const tensor of Object.values(tensors)) tensor.destroy();
  return held;
}

test('load, draw and destroy, over and over', async () => {
  const device = await deviceWith([]);
  device.pushErrorScope('validation');
  const ledger = watchMemory(device);
  // Resources that exist once for each device stay.
  for (const i of [0, 1, 2]) await cycle(device, i);
  const [bytes, objects] = [ledger.bytes, ledger.objects];
  const cycles = sized(9, 500);
  let held = 0;
  for (let i = 0; i < cycles; i++) held += await cycle(device, i);
  assert.ok(held > 0, 'there was something to leak');
  ledger.stop();
  holds('S23', `${cycles} cycles: bytes that stay on the GPU`, ledger.bytes - bytes, {
    atLeast: 0,
    atMost: 0,
    unit: 'bytes',
  });
  holds('S23', `${cycles} cycles: objects that stay on the GPU`, ledger.objects - objects, {
    atLeast: 0,
    atMost: 0,
    unit: 'objects',
  });
  assert.equal(await device.popErrorScope(), null);
  device.destroy();
});

test('the renderer says how much it holds, to the byte', async () => {
  const device = await deviceWith([]);
  const ledger = watchMemory(device);
  const gaussians = await GaussianBuffers.upload(device, packed);
  assert.equal(ledger.bytes, gaussians.byteLength, `of a scene: ${ledger.labels.join()}`);
  const before = ledger.bytes;
  const renderer = new Renderer(device, { threads: THREADS, rasterizer: 'quads' });
  await capture(device, renderer, { gaussians, camera: resized(cameras[0], 64) });
  const shared = ledger.labels.filter((label) => label === 'gs.rasterize.indices').length;
  assert.equal(shared, 1, 'indices are shared by all renderers of a device');
  const uncounted = ledger.bytes - before - renderer.byteLength;
  // Indices of the quads belong to the device, a staging buffer of 16 bytes to the watch over capacity.
  holds('S23', 'bytes on the GPU that byteLength does not include', uncounted, {
    atLeast: 0,
    atMost: 2048,
    unit: 'bytes',
  });
  ledger.stop();
  device.destroy();
});
