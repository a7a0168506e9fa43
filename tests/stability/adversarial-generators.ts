/**
 * S24. Generators that write nonsense, too much, nothing, or late.
 *
 * Who fails: Visionary's shader has the check of the row number commented out (read in preprocess.wgsl), so rows of an earlier run stay visible; ONNX Runtime #26367 reports float16 models that write NaN.
 *
 * Recipe: asked for NaN, counts that change, 0 and too many rows, late, throwing, times out of range, another type. Run with 300 random sequences of runs; tests that need a session are in tests/generator/browser.
 *
 * Passes: for any output of a run, and any order of runs, the image is that of the usable rows of the last accepted run; a refused run changes nothing and has a
 * code. Generators that are late, throw or lose their device are tried in the element: tests/generator/browser.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import fc from 'fast-check';
import { GaussianSplatError } from '@gaussian-splat/core';
import { DynamicGaussians } from '@gaussian-splat/renderer';
import { writeTensors } from '../support/generator-tensors.js';
import { nodeDevice } from '../support/node-device.js';
import { offCenter } from '../support/scenes.js';
import { differingBytes, resized, THREADS } from './support/images.js';
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
const camera = resized(cameras[0], 72);
const written = writeTensors(cloud, SPEC);
const [tensorName, words] = Object.entries(written.tensors)[0];
const rows = new Float32Array(words.slice().buffer);
const width = rows.length / cloud.count;

/** Output of one run. */
const run = fc.record({
  rows: fc.oneof(
    { weight: 4, arbitrary: fc.nat(cloud.count) },
    { weight: 1, arbitrary: fc.constantFrom(0, cloud.count, cloud.count + 1, 2 ** 31, -1, 1.5, NaN) },
  ),
  /** Interval of the corrupted rows, none for 0. */
  spoil: fc.constantFrom(0, 1, 2, 7),
  value: fc.constantFrom(NaN, Infinity, -Infinity, 3e38, -1e30),
  column: fc.nat(width - 1),
  shift: fc.double({ min: -1, max: 1, noNaN: true }),
});

function contentOf({
  spoil,
  value,
  column,
  shift,
}: {
  spoil: number;
  value: number;
  column: number;
  shift: number;
}): Float32Array<ArrayBuffer> {
  const content = rows.slice();
  for (let i = 0; i < cloud.count; i++) {
    content[width * i] += shift;
    if (spoil > 0 && i % spoil === 0) content[width * i + column] = value;
  }
  return content;
}

async function drawFresh(device: GPUDevice, tensor: GPUBuffer, count: number): Promise<Float32Array> {
  const gaussians = await DynamicGaussians.create(device, written.layout);
  const renderer = new Renderer(device, { threads: THREADS });
  gaussians.ingest({ [tensorName]: tensor }, count);
  const pixels = await capture(device, renderer, { gaussians, camera });
  renderer.destroy();
  gaussians.destroy();
  return pixels;
}

test('any sequence of runs', async () => {
  const device = await nodeDevice();
  let [differing, refused] = [0, 0];
  await fc.assert(
    fc.asyncProperty(fc.array(run, { minLength: 1, maxLength: 6 }), async (runs) => {
      const gaussians = await DynamicGaussians.create(device, written.layout);
      const renderer = new Renderer(device, { threads: THREADS });
      const tensor = device.createBuffer({ size: rows.byteLength, usage: 0x80 | 0x8 });
      const last = device.createBuffer({ size: rows.byteLength, usage: 0x80 | 0x8 });
      let accepted: number | undefined;
      for (const one of runs) {
        const content = contentOf(one);
        device.queue.writeBuffer(tensor, 0, content);
        try {
          gaussians.ingest({ [tensorName]: tensor }, one.rows);
          accepted = one.rows;
          device.queue.writeBuffer(last, 0, content);
        } catch (error) {
          assert.ok(error instanceof GaussianSplatError && error.code === 'contract/rows', String(error));
          refused++;
        }
        await capture(device, renderer, { gaussians, camera });
      }
      const found = await capture(device, renderer, { gaussians, camera });
      const expected = accepted ? await drawFresh(device, last, accepted) : new Float32Array(found.length);
      assert.ok(found.every(Number.isFinite), 'numbers that are not finite');
      const count = differingBytes(found, expected);
      differing += count;
      for (const thing of [renderer, gaussians, tensor, last]) thing.destroy();
      return count === 0;
    }),
    { numRuns: sized(5, 300), seed: 24 },
  );
  holds('S24', 'bytes that differ from the last accepted run alone', differing, { atMost: 0, unit: 'bytes' });
  holds('S24', 'runs that were refused, by name', refused, { atLeast: 1, unit: 'runs' });
});

/** A count of rows in a tensor, which the CPU does not check. */
test('a count of any 32 bits shows no unwritten row', async () => {
  const device = await nodeDevice();
  const layout = { ...written.layout, count: 'live' };
  const tensor = device.createBuffer({ size: rows.byteLength, usage: 0x80 | 0x8 });
  device.queue.writeBuffer(tensor, 0, rows);
  let differing = 0;
  for (const live of [0, 1, 255, 256, 257, cloud.count, cloud.count + 1, 0x7fffffff, 0x80000000, 0xffffffff]) {
    const count = device.createBuffer({ size: 8, usage: 0x80 | 0x8 | 0x4 });
    device.queue.writeBuffer(count, 0, Uint32Array.of(live, 0));
    const gaussians = await DynamicGaussians.create(device, layout);
    const renderer = new Renderer(device, { threads: THREADS });
    gaussians.ingest({ [tensorName]: tensor, live: count }, cloud.count);
    const found = await capture(device, renderer, { gaussians, camera });
    // A negative int32 is no row at all.
    const shown = live > 0x7fffffff ? [0, cloud.count] : [Math.min(live, cloud.count)];
    const differences: number[] = [];
    for (const rows of shown) {
      const expected = rows ? await drawFresh(device, tensor, rows) : new Float32Array(found.length);
      differences.push(differingBytes(found, expected));
    }
    differing += Math.min(...differences);
    for (const thing of [renderer, gaussians, count]) thing.destroy();
  }
  holds('S24', 'random counts of rows: differing bytes', differing, { atMost: 0, unit: 'bytes' });
});
