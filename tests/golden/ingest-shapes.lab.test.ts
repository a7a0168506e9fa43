/** The same Gaussians in every shape that a model may write them in: each is drawn to the same pixels. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { gaussianLayout, type Contract, type SplitOutputs } from '@gaussian-splat/core/contract';
import type { OnnxTensor } from '@gaussian-splat/core/onnx';
import { DynamicGaussians } from '@gaussian-splat/renderer';
import { headerWith, tensor } from '../contract/support.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { resized, room } from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

const COUNT = 300;
const { uniform } = seededRandom(11);
const rows = (width: number, at: (row: number, column: number) => number): number[][] =>
  Array.from({ length: COUNT }, (_, row) => Array.from({ length: width }, (__, column) => at(row, column)));

const positions = rows(3, () => uniform(-0.7, 0.7));
/** All three scales of round Gaussians are 1. */
const sizes = rows(1, () => uniform(0.01, 0.06));
const scales = sizes.map(([size]) => [size, size, size]);
const rotations = rows(4, () => uniform(0.1, 1));
const colors = rows(3, () => uniform(0, 1));
const opacities = rows(1, () => uniform(0.2, 0.95));
/** L Lᵀ of a random lower triangle. */
const matrices = Array.from({ length: COUNT }, () => {
  const [a, b, c, d, e, f] = Array.from({ length: 6 }, () => uniform(0.01, 0.05));
  return [a * a, a * b, a * d, a * b, b * b + c * c, b * d + c * e, a * d, b * d + c * e, d * d + e * e + f * f];
});
const covariances = matrices.map(([xx, xy, xz, , yy, yz, , , zz]) => [xx, xy, xz, yy, yz, zz]);

interface Written {
  readonly dims: OnnxTensor['dims'];
  readonly values: readonly (readonly number[])[];
  readonly dtype?: OnnxTensor['dtype'];
}

const written = (dims: OnnxTensor['dims'], values: Written['values'], dtype?: Written['dtype']): Written => ({
  dims,
  values,
  dtype,
});
const PLAIN: SplitOutputs = {
  layout: 'split',
  positions: 'positions',
  colors: 'colors',
  opacities: 'opacities',
  opacityActivation: 'linear',
};
const BY_COVARIANCES: SplitOutputs = { ...PLAIN, covariances: 'covariances' };
const BY_AXES = {
  ...PLAIN,
  scales: 'scales',
  rotations: 'rotations',
  scaleActivation: 'linear',
  rotationOrder: 'wxyz',
} as const;
const COMMON: Record<string, Written> = {
  positions: written([COUNT, 3], positions),
  colors: written([COUNT, 3], colors),
  opacities: written([COUNT, 1], opacities),
};
const BATCHED: Record<string, Written> = {
  positions: written([1, COUNT, 3], positions),
  colors: written([1, 1, COUNT, 3], colors),
  opacities: written([1, COUNT], opacities),
};
const withCovariances = (shape: Written): Record<string, Written> => ({ ...COMMON, covariances: shape });
const withAxes = (shape: Written): Record<string, Written> => ({
  ...COMMON,
  scales: shape,
  rotations: written([COUNT, 4], rotations),
});
const flat = (...attributes: (readonly (readonly number[])[])[]): number[][] =>
  Array.from({ length: COUNT }, (_, row) => attributes.flatMap((attribute) => [...attribute[row]]));

/** Pixels of a model's output. */
async function draw(
  outputs: Contract['outputs'],
  tensors: Record<string, Written>,
  facts: Partial<Contract> = {},
): Promise<Float32Array> {
  const device = await serialDevice();
  const header = headerWith(
    [],
    Object.entries(tensors).map(([name, { dims, dtype }]) => tensor(name, dims, dtype)),
  );
  const layout = gaussianLayout(header, { version: 1, inputs: {}, outputs, ...facts })!;
  const gaussians = await DynamicGaussians.create(device, layout);
  const buffers = Object.entries(tensors).map(([name, { values, dtype }]) => {
    const numbers = values.flat();
    const data =
      dtype === 'int64'
        ? BigInt64Array.from(numbers, BigInt)
        : dtype === 'int32'
          ? Int32Array.from(numbers)
          : Float32Array.from(numbers);
    const buffer = device.createBuffer({ size: data.byteLength, usage: 0x80 | 0x8 | 0x4 });
    device.queue.writeBuffer(buffer, 0, data as BufferSource);
    return [name, buffer] as const;
  });
  gaussians.ingest(Object.fromEntries(buffers), tensors[Object.keys(tensors)[0]].values.length);
  const renderer = new Renderer(device);
  const camera = resized(room().cameras[0], 96);
  const pixels = await capture(device, renderer, {
    gaussians,
    camera: { ...camera, worldToCamera: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 2.5, 0, 0, 0, 1] },
  });
  renderer.destroy();
  gaussians.destroy();
  return pixels;
}

after(endNodeDevice);

test('covariances of six numbers and of nine, in batches or not', async () => {
  const plain = await draw(BY_COVARIANCES, withCovariances(written([COUNT, 6], covariances)));
  assert.ok(
    plain.some((value) => value > 0.1),
    'something is drawn',
  );
  assert.deepEqual(await draw(BY_COVARIANCES, withCovariances(written([COUNT, 3, 3], matrices))), plain);
  assert.deepEqual(await draw(BY_COVARIANCES, { ...BATCHED, covariances: written([1, COUNT, 3, 3], matrices) }), plain);
  const alpha = written(
    [COUNT, 4],
    colors.map((color) => [...color, 0.123]),
  );
  assert.deepEqual(
    await draw(BY_COVARIANCES, { ...withCovariances(written([COUNT, 6], covariances)), colors: alpha }),
    plain,
  );
});

test('one scale a splat, and rows whose attributes are in another order', async () => {
  const plain = await draw(BY_AXES, withAxes(written([COUNT, 3], scales)));
  assert.ok(
    plain.some((value) => value > 0.1),
    'something is drawn',
  );
  assert.deepEqual(await draw(BY_AXES, withAxes(written([COUNT, 1], sizes))), plain);
  assert.deepEqual(await draw(BY_AXES, withAxes(written([COUNT], sizes))), plain);
  const lgm = {
    layout: 'packed',
    gaussians: 'gaussians',
    color: 'rgb',
    opacityActivation: 'linear',
    columns: ['positions', 'opacities', 'scales', 'rotations', 'colors'],
    scaleActivation: 'linear',
    rotationOrder: 'wxyz',
  } as const;
  const gaussians = written([1, COUNT, 14], flat(positions, opacities, scales, rotations, colors));
  assert.deepEqual(await draw(lgm, { gaussians }), plain);
});

test('a padded tensor has room for its living rows only; the count may be of 64 bits', async () => {
  const living = 120;
  const cut = Object.fromEntries(
    Object.entries(withCovariances(written([COUNT, 6], covariances))).map(([name, { dims, values }]) => [
      name,
      written([living, ...dims!.slice(1)], values.slice(0, living)),
    ]),
  );
  const plain = await draw(BY_COVARIANCES, cut);
  for (const dtype of ['int32', 'int64'] as const) {
    const padded = { ...withCovariances(written([COUNT, 6], covariances)), count: written([1], [[living]], dtype) };
    const outputs = { ...BY_COVARIANCES, count: 'count' };
    assert.deepEqual(await draw(outputs, padded, { nMax: 150 }), plain, dtype);
  }
});
