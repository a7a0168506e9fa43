/**
 * S5. NaN, infinities, zero quaternions, denormals.
 *
 * Who fails: PlayCanvas #7243 and #7592, splat-transform #288: one such number in a file and parts of the image or all of it are gone.
 *
 * Recipe: asked for each attribute with NaN, infinities, -0, denormals, the largest number and a zero quaternion, in files and in what generators write. Run
 * so for files; for generators with NaN and infinities in every column of the rows.
 *
 * Passes: with bad splats of every kind mixed in, from a file and from a generator's tensors, the image is bit for bit that of the scene
 * without them, and they are counted.
 * SECURITY.md: "Scene and model files are untrusted data".
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { DynamicGaussians, packGaussians } from '@gaussian-splat/renderer';
import { writeTensors } from '../support/generator-tensors.js';
import { nodeDevice } from '../support/node-device.js';
import { offCenter, room, withHostileSplats } from '../support/scenes.js';
import { differingBytes, draw, RASTERIZERS, resized, THREADS } from './support/images.js';
import { holds, sized } from './support/row.js';
import { capture, Renderer } from '../support/renderer.js';

const scene = sized(offCenter, room)();
const camera = resized(scene.cameras[0], 120);

for (const rasterizer of RASTERIZERS) {
  test(`in a file, ${rasterizer}`, async () => {
    const device = await nodeDevice();
    const { cloud, bad } = withHostileSplats(scene.cloud);
    assert.equal(packGaussians(cloud).droppedCount, bad.length, 'counted');
    const [clean, hostile] = [
      await draw(device, scene.cloud, camera, { rasterizer }),
      await draw(device, cloud, camera, { rasterizer }),
    ];
    holds('S5', `${bad.length} bad splats in a file, ${rasterizer}: differing bytes`, differingBytes(clean, hostile), {
      atMost: 0,
      unit: 'bytes',
    });
  });
}

const SPEC = {
  layout: 'packed',
  shape: 'scale',
  color: 'coefficient-major',
  opacity: 'linear',
  quaternionOrder: 'wxyz',
  dtype: 'float32',
} as const;

/** The image of rows as a generator writes them. */
async function drawTensors(
  rows: Float32Array<ArrayBuffer>,
  width: number,
): Promise<{ pixels: Float32Array; unusable: number }> {
  const device = await nodeDevice();
  const { layout } = writeTensors(scene.cloud, SPEC);
  const count = rows.length / width;
  const gaussians = await DynamicGaussians.create(device, { ...layout, capacity: count });
  const tensor = device.createBuffer({ size: rows.byteLength, usage: 0x80 | 0x8 | 0x4 });
  device.queue.writeBuffer(tensor, 0, rows);
  gaussians.ingest({ [Object.keys(writeTensors(scene.cloud, SPEC).tensors)[0]]: tensor }, count);
  const renderer = new Renderer(device, { threads: THREADS });
  const pixels = await capture(device, renderer, { gaussians, camera });
  const { unusable } = await renderer.stats();
  renderer.destroy();
  gaussians.destroy();
  tensor.destroy();
  return { pixels, unusable };
}

test('in the tensors of a generator', async () => {
  const { tensors } = writeTensors(scene.cloud, SPEC);
  const words = Object.values(tensors)[0];
  const clean = new Float32Array(words.slice().buffer);
  const width = clean.length / scene.cloud.count;
  // A bad copy of every tenth row behind it, corrupted in one column after the other; the last rows replace the missing ones.
  const faults = [NaN, Infinity, -Infinity];
  const rows: number[][] = [];
  let bad = 0;
  for (let i = 0; i < scene.cloud.count; i++) {
    const row = Array.from(clean.subarray(width * i, width * (i + 1)));
    rows.push(row);
    if (i % 10) continue;
    const spoilt = [...row];
    spoilt[bad % width] = faults[Math.floor(bad / width) % 3];
    rows.push(spoilt);
    bad++;
  }
  const plain = await drawTensors(clean, width);
  const hostile = await drawTensors(Float32Array.from(rows.flat()), width);
  holds('S5', `${bad} bad rows from a generator: differing bytes`, differingBytes(plain.pixels, hostile.pixels), {
    atMost: 0,
    unit: 'bytes',
  });
  holds('S5', 'bad rows from a generator that are counted, of those in view', hostile.unusable, {
    atLeast: 1,
    atMost: bad,
    unit: 'rows',
  });
});
