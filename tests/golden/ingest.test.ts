/** Gaussians that come as a generator's tensors, drawn, against the same Gaussians packed on the CPU. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { DynamicGaussians, GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { mortonOrder } from '@gaussian-splat/renderer/stages';
import { writeTensors, type TensorSpec, type WrittenTensors } from '../support/generator-tensors.js';
import { isLab, someOf } from '../support/extent.js';
import { psnr } from '../support/metrics.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import {
  brightColors,
  edgeOnDiscs,
  hugeSplats,
  needles,
  opacitySteps,
  resized,
  room,
  thinned,
} from '../support/scenes.js';
import type { Scene } from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

const LIMIT_DB = 55;
let made: Scene | undefined;
/** Generators' tensors are written and read here in plain code, number by number: fewer splats than the whole room has. */
const smallRoom = (): Scene => (made ??= thinned(room(), isLab ? 8_000 : 4_000));
/**
 * Rounded to float16, covariances of needles and discs are indefinite: they have no reference image, only a bound of the difference between two repairs. The accuracy of each is tested below.
 */
const MENDED_DB = 35;
const SPECS: readonly Omit<TensorSpec, 'dtype'>[] = [
  { layout: 'packed', shape: 'covariance', color: 'coefficient-major', opacity: 'linear', quaternionOrder: 'wxyz' },
  { layout: 'split', shape: 'log-scale', color: 'channel-major', opacity: 'logit', quaternionOrder: 'xyzw' },
];

/**
 * The cloud in the order that packing it would give it: rounded to float16 many splats have equal depths, and those are blended in
 * their order.
 */
function inDrawnOrder(cloud: GaussianCloud, spec: TensorSpec): GaussianCloud {
  const { positions } = writeTensors(cloud, spec).cloud;
  const order = mortonOrder(
    positions,
    Uint32Array.from({ length: cloud.count }, (_, i) => i),
  );
  const permuted = (values: Float32Array): Float32Array => {
    const width = values.length / cloud.count;
    return values.map((_, i) => values[width * order[Math.floor(i / width)] + (i % width)]);
  };
  const { scales, rotations, opacities, sh } = cloud;
  return {
    ...cloud,
    positions: permuted(cloud.positions),
    scales: permuted(scales),
    rotations: permuted(rotations),
    opacities: permuted(opacities),
    sh: permuted(sh),
  };
}

/** Premultiplied pixels, and a mask of those that any splat covers. */
async function drawCloud(cloud: GaussianCloud, camera: Camera): Promise<{ pixels: Float32Array; mask: Uint8Array }> {
  const device = await serialDevice();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud, { sh: 'float16' }));
  const renderer = new Renderer(device);
  const pixels = await capture(device, renderer, { gaussians, camera });
  renderer.destroy();
  gaussians.destroy();
  return { pixels, mask: Uint8Array.from({ length: pixels.length / 4 }, (_, i) => Number(pixels[4 * i + 3] > 0)) };
}

async function uploadTensors({ tensors }: WrittenTensors): Promise<Record<string, GPUBuffer>> {
  const device = await serialDevice();
  return Object.fromEntries(
    Object.entries(tensors).map(([name, words]) => {
      const buffer = device.createBuffer({ size: words.byteLength, usage: 0x80 | 0x8 | 0x4 });
      device.queue.writeBuffer(buffer, 0, words);
      return [name, buffer];
    }),
  );
}

for (const dtype of ['float32', 'float16'] as const) {
  for (const one of someOf(SPECS, dtype === 'float32' ? 2 : 1)) {
    test(`ingest, ${one.layout}, ${one.shape}, ${dtype}: the frame of the CPU's packing`, async () => {
      const device = await serialDevice();
      for (const make of someOf([smallRoom, needles, hugeSplats, opacitySteps, brightColors, edgeOnDiscs], 2)) {
        const { name, cloud, cameras } = make();
        const written = writeTensors(inDrawnOrder(cloud, { ...one, dtype }), { ...one, dtype });
        const gaussians = await DynamicGaussians.create(device, written.layout);
        gaussians.ingest(await uploadTensors(written), cloud.count);
        const renderer = new Renderer(device);
        const camera = resized(cameras[0], 160);
        const { pixels, mask } = await drawCloud(written.cloud, camera);
        const decibels = psnr(await capture(device, renderer, { gaussians, camera }), pixels, { mask, channels: 4 });
        console.log(`ingest ${one.shape} ${dtype} ${name}`.padEnd(45), `${decibels.toFixed(2)} dB`);
        const isMended = dtype === 'float16' && one.shape === 'covariance' && [needles, edgeOnDiscs].includes(make);
        assert.ok(decibels >= (isMended ? MENDED_DB : LIMIT_DB), `${name}: ${decibels} dB`);
        renderer.destroy();
        gaussians.destroy();
      }
    });
  }
}

/**
 * The error of shapes in float16, without other rounding errors: against the original shapes, drawn at the rounded positions with the rounded
 * colors. Beside ours stands the best that any reader could make of the same numbers, their nearest positive semi-definite matrix.
 */
test('ingest, float16: needles and discs lose digits as covariances, by the format and not by the reader, and none as axes', async () => {
  const device = await serialDevice();
  for (const make of [needles, edgeOnDiscs]) {
    const { name, cloud, cameras } = make();
    const camera = resized(cameras[0], 160);
    const found: Record<string, number> = {};
    for (const one of SPECS) {
      const spec = { ...one, dtype: 'float16' } as const;
      const ordered = inDrawnOrder(cloud, spec);
      const written = writeTensors(ordered, spec);
      const { scales, rotations } = ordered;
      const { pixels, mask } = await drawCloud({ ...written.cloud, scales, rotations }, camera);
      const gaussians = await DynamicGaussians.create(device, written.layout);
      gaussians.ingest(await uploadTensors(written), cloud.count);
      const renderer = new Renderer(device);
      found[one.shape] = psnr(await capture(device, renderer, { gaussians, camera }), pixels, { mask, channels: 4 });
      found[`best ${one.shape}`] = psnr((await drawCloud(written.cloud, camera)).pixels, pixels, { mask, channels: 4 });
      renderer.destroy();
      gaussians.destroy();
    }
    const words = Object.entries(found).map(([shape, decibels]) => `${shape} ${decibels.toFixed(2)} dB`);
    console.log(`float16 ${name}`.padEnd(25), words.join(', '));
    assert.ok(found.covariance >= found['best covariance'] - 3, `${name}: ${found.covariance} dB`);
    assert.ok(found['log-scale'] >= 50, `${name}: ${found['log-scale']} dB`);
  }
});

test('ingest: a new run replaces all of the old one, also for a camera that stands still', async () => {
  const device = await serialDevice();
  const { cloud, cameras } = smallRoom();
  const spec = { ...SPECS[0], dtype: 'float32' } as const;
  const moved = { ...cloud, positions: cloud.positions.map((x, i) => (i % 3 === 2 ? x + 1.5 : x)) };
  const written = writeTensors(cloud, spec);
  const [first, second] = [await uploadTensors(written), await uploadTensors(writeTensors(moved, spec))];
  const gaussians = await DynamicGaussians.create(device, written.layout);
  const renderer = new Renderer(device);
  const camera = resized(cameras[0], 160);
  const draw = (): Promise<Float32Array> => capture(device, renderer, { gaussians, camera });
  assert.ok(
    (await draw()).every((x) => x === 0),
    'nothing before the first run',
  );
  gaussians.ingest(first, cloud.count);
  // Long enough still for an order of all splats, which must not outlive its content.
  let before = await draw();
  for (let frame = 0; frame < 4; frame++) before = await draw();
  gaussians.ingest(second, cloud.count);
  const after = await draw();
  const { pixels, mask } = await drawCloud(moved, camera);
  const [close, far] = [after, before].map((image) => psnr(image, pixels, { mask, channels: 4 }));
  console.log(`ingest: the new run ${close.toFixed(2)} dB, the old one ${far.toFixed(2)} dB`);
  assert.ok(close >= LIMIT_DB && far < 40, `${close} dB, ${far} dB`);
  gaussians.ingest({}, 0);
  assert.ok(
    (await draw()).every((x) => x === 0),
    'nothing after a run without Gaussians',
  );
  renderer.destroy();
  gaussians.destroy();
});

test('ingest: bounds come from what is drawn', async () => {
  const device = await serialDevice();
  const { cloud } = smallRoom();
  const written = writeTensors(cloud, { ...SPECS[0], dtype: 'float32' });
  const gaussians = await DynamicGaussians.create(device, written.layout);
  gaussians.ingest(await uploadTensors(written), cloud.count);
  const { min, max } = await gaussians.readBounds();
  for (let axis = 0; axis < 3; axis++) {
    const column = Array.from({ length: cloud.count }, (_, i) => cloud.positions[3 * i + axis]);
    assert.deepEqual([min[axis], max[axis]], [Math.min(...column), Math.max(...column)]);
  }
  gaussians.destroy();
});

test('ingest: rows that cannot be drawn are counted, rows without opacity and centers that meet are none of them', async () => {
  const device = await serialDevice();
  const { cloud } = smallRoom();
  const written = writeTensors(cloud, { ...SPECS[0], dtype: 'float32' });
  const gaussians = await DynamicGaussians.create(device, written.layout);
  const sampleOf = async (change: (positions: Float32Array, opacities: Float32Array) => void) => {
    const changed = { ...cloud, positions: cloud.positions.slice(), opacities: cloud.opacities.slice() };
    change(changed.positions, changed.opacities);
    gaussians.ingest(await uploadTensors(writeTensors(changed, { ...SPECS[0], dtype: 'float32' })), cloud.count);
    const { drawn, unusable } = await gaussians.readSample();
    assert.equal(gaussians.droppedCount, unusable);
    return [drawn, unusable];
  };
  const { count } = cloud;
  assert.deepEqual(await sampleOf((positions) => positions.fill(0)), [count, 0], 'all centers in the origin');
  assert.deepEqual(await sampleOf((_, opacities) => opacities.fill(0)), [0, 0], 'no opacity');
  const spoil = (positions: Float32Array): void => void positions.fill(NaN, 0, 7 * 3);
  assert.deepEqual(await sampleOf(spoil), [count - 7, 7], 'seven rows');
  assert.deepEqual(await sampleOf((positions) => positions.fill(NaN)), [0, count], 'all rows');
  gaussians.destroy();
});

test('ingest: a tensor that is missing or too small, or too many rows, is refused and changes nothing', async () => {
  const device = await serialDevice();
  const { cloud } = smallRoom();
  const { layout } = writeTensors(cloud, { ...SPECS[0], dtype: 'float32' });
  const gaussians = await DynamicGaussians.create(device, layout);
  const before = gaussians.version;
  const small = device.createBuffer({ size: 64, usage: 0x80 });
  assert.throws(() => gaussians.ingest({ gaussians: small }, cloud.count), { code: 'argument/value' });
  assert.throws(() => gaussians.ingest({}, cloud.count), { code: 'argument/value' });
  assert.throws(() => gaussians.ingest({ gaussians: small }, cloud.count + 1), { code: 'contract/rows' });
  assert.equal(gaussians.version, before);
  gaussians.destroy();
});

after(endNodeDevice);
