import { DynamicGaussians } from '@gaussian-splat/renderer';
import { constants, scaleRotationFactor, shWords } from '@gaussian-splat/renderer/stages';
import { halfToNumber, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import type { GaussianLayout } from '@gaussian-splat/core/contract';
import { check, checkEqual, withBufferLimit, type Bench, type StageCase } from '../../support/gpu.js';
import { covarianceOf, writeTensors, type TensorSpec, type WrittenTensors } from '../../support/generator-tensors.js';
import { edgeOnDiscs, hugeSplats, needles, room, thinned, type Scene } from '../../support/scenes.js';

const SPECS: Readonly<Record<string, TensorSpec>> = {
  'packed, covariances, colors': spec('packed', 'covariance', 'rgb', 'linear'),
  'packed, covariances, harmonics': spec('packed', 'covariance', 'coefficient-major', 'logit'),
  'split, scales': spec('split', 'scale', 'channel-major', 'linear', 'xyzw'),
  'split, logarithms': spec('split', 'log-scale', 'coefficient-major', 'logit', 'wxyz'),
};

function spec(
  layout: TensorSpec['layout'],
  shape: TensorSpec['shape'],
  color: TensorSpec['color'],
  opacity: TensorSpec['opacity'],
  quaternionOrder: TensorSpec['quaternionOrder'] = 'wxyz',
): TensorSpec {
  return { layout, shape, color, opacity, quaternionOrder, dtype: 'float32' };
}

/** Every number of every row is compared: enough rows for several workgroups, and for slices of several scenes. */
const ROWS = 6_000;
let made: Scene | undefined;
const smallRoom = (): Scene => (made ??= thinned(room(), ROWS));

interface Ingested {
  readonly geometry: Uint32Array;
  readonly sh: Uint32Array;
  readonly chunks: Float32Array;
}

async function ingestOnGpu(
  bench: Bench,
  { layout, tensors }: Pick<WrittenTensors, 'layout' | 'tensors'>,
  rows = layout.capacity,
): Promise<Ingested> {
  const gaussians = await DynamicGaussians.create(bench.device, layout);
  const buffers = Object.entries(tensors).map(([name, words]) => [name, bench.buffer(words)] as const);
  gaussians.ingest(Object.fromEntries(buffers), rows);
  const [page] = gaussians.blocks;
  const result = {
    geometry: await bench.read(page.geometry),
    sh: await bench.read(page.sh),
    chunks: new Float32Array((await bench.read(page.chunks)).buffer),
  };
  gaussians.destroy();
  return result;
}

/** Numbers of a packed splat: factor xx, yx, yy, zx, zy, zz and the opacity. */
function shapeOf(words: Uint32Array, i: number): number[] {
  const [a, b, c, d, e] = words.subarray(8 * i + 3, 8 * i + 8);
  const own = [a, b, c, d, e].map((word) => word & 0xfffffc00);
  const last = (a << 22) | ((b & 0x3ff) << 12) | ((c & 0x300) << 2);
  const opacity = (c << 24) | ((d & 0x3ff) << 14) | ((e & 0x3ff) << 4);
  return Array.from(new Float32Array(Int32Array.of(...own, last, opacity).buffer));
}

/** xx, yy and zz among xx, xy, xz, yy, yz, zz. */
const VARIANCES = [0, 3, 5];

const product = ([xx, yx, yy, zx, zy, zz]: number[]): number[] => [
  xx * xx,
  xx * yx,
  xx * zx,
  yx * yx + yy * yy,
  yx * zx + yy * zy,
  zx * zx + zy * zy + zz * zz,
];

/**
 * The twin: every number of every splat, as float64 has it. Packing keeps 14 bits of the factor and 20 of the opacity. Rounded to
 * float16 the covariances of flat and thin splats are often indefinite, and then there is more than one repair: only
 * their variances are compared.
 */
function checkAgainstTwin({ geometry, sh }: Ingested, cloud: GaussianCloud, name: string, one: TensorSpec): void {
  const hasAxes = one.shape !== 'covariance';
  const isRounded = one.dtype === 'float16' && !hasAxes;
  const floats = new Float32Array(geometry.buffer);
  const factor = new Float64Array(6);
  for (let i = 0; i < cloud.count; i++) {
    const at = `${name}, row ${i}`;
    checkEqual(floats.subarray(8 * i, 8 * i + 3), cloud.positions.subarray(3 * i, 3 * i + 3), `${at}: position`);
    const shape = shapeOf(geometry, i);
    const expected = covarianceOf(cloud, i);
    const trace = expected[0] + expected[3] + expected[5];
    const found = product(shape);
    const tolerance = isRounded ? 1e-3 * trace + 2 ** -23 : 3e-4 * trace;
    const thinnest = Math.min(...cloud.scales.subarray(3 * i, 3 * i + 3)) ** 2;
    const isSafe = !isRounded || thinnest > 2 * tolerance;
    expected.forEach((value, k) => {
      if (Math.abs(found[k] - value) <= tolerance || !(isSafe || VARIANCES.includes(k))) return;
      throw new Error(`${at}: covariance ${k} is ${found[k]}, expected ${value}`);
    });
    if (hasAxes) {
      scaleRotationFactor(cloud, i, factor);
      // A small pivot divides the rounding error; its product with the pivot, which Σ is made of, stays small.
      const pivot = Math.max(1e-3 * Math.sqrt(trace), Math.min(factor[0], factor[2]));
      const slack = 4e-6 * Math.sqrt(trace) + (1e-6 * trace) / pivot;
      factor.forEach((value, k) => {
        if (Math.abs(shape[k] - value) <= 7e-5 * Math.abs(value) + slack) return;
        throw new Error(`${at}: factor ${k} is ${shape[k]}, not ${value}`);
      });
    }
    const opacity = Math.min(1, Math.max(0, cloud.opacities[i]));
    check(Math.abs(shape[6] - opacity) <= 3e-6 * opacity + 1e-30, `${at}: opacity ${shape[6]}, expected ${opacity}`);
  }
  checkHarmonics(sh, cloud, name);
}

function checkHarmonics(sh: Uint32Array, cloud: GaussianCloud, name: string): void {
  const halves = new Uint16Array(sh.buffer);
  const numbers = 3 * shCoefficientCount(cloud.shDegree);
  const stride = 2 * shWords(cloud.shDegree, 'float16');
  for (let i = 0; i < cloud.count * numbers; i++) {
    const [row, k] = [Math.floor(i / numbers), i % numbers];
    const [found, expected] = [halfToNumber(halves[row * stride + k]), cloud.sh[i]];
    if (Math.abs(found - expected) <= 1e-3 * Math.abs(expected) + 1e-6) continue;
    throw new Error(`${name}: harmonic ${k} of row ${row} is ${found}, expected ${expected}`);
  }
}

/** Every splat that reaches anything lies within its chunk's bounds. */
function checkChunks(chunks: Float32Array, cloud: GaussianCloud, name: string): void {
  for (let i = 0; i < cloud.count; i++) {
    const chunk = chunks.subarray(8 * Math.floor(i / constants.CULL_GROUP));
    const radius = Math.sqrt(2 * Math.log(Math.max(1, 255 * cloud.opacities[i])));
    const reach = radius * Math.max(...cloud.scales.subarray(3 * i, 3 * i + 3));
    for (let axis = 0; axis < 3; axis++) {
      const x = cloud.positions[3 * i + axis];
      check(chunk[axis] <= x && x <= chunk[4 + axis], `${name}: splat ${i} lies outside of its chunk`);
    }
    check(chunk[3] >= 0.9999 * reach, `${name}: splat ${i} reaches ${reach}, its chunk ${chunk[3]}`);
  }
}

const againstTwin: StageCase[] = Object.entries(SPECS).flatMap(([what, one]) =>
  (['float32', 'float16'] as const).map((dtype) => ({
    name: `ingest: ${what}, ${dtype}`,
    async run(bench: Bench) {
      for (const make of [smallRoom, needles, hugeSplats, edgeOnDiscs]) {
        const { name, cloud } = make();
        const written = writeTensors(cloud, { ...one, dtype });
        const ingested = await ingestOnGpu(bench, written);
        checkAgainstTwin(ingested, written.cloud, name, { ...one, dtype });
        checkChunks(ingested.chunks, written.cloud, name);
      }
    },
  })),
);

const PLAIN: TensorSpec = SPECS['packed, covariances, colors'];
const COLUMNS = 13;

/** Zero geometry: what `cull` refuses and counts. */
const isNothing = (geometry: Uint32Array, row: number): boolean =>
  geometry.subarray(8 * row, 8 * row + 8).every((word) => word === 0);

const hostile: StageCase = {
  name: 'ingest: rows with NaN, infinity or no extent become nothing, and their neighbors stay',
  async run(bench) {
    const { cloud } = smallRoom();
    for (const dtype of ['float32', 'float16'] as const) {
      const { layout, tensors, cloud: read } = writeTensors(cloud, { ...PLAIN, dtype });
      const words = tensors.gaussians.slice();
      const values = dtype === 'float16' ? new Uint16Array(words.buffer) : new Uint32Array(words.buffer);
      const bad = dtype === 'float16' ? [0x7e00, 0x7c00, 0xfc00] : [0x7fc00000, 0x7f800000, 0xff800000];
      const broken = new Set<number>();
      for (let column = 0; column < COLUMNS; column++) {
        bad.forEach((bits, kind) => {
          const row = 3 * (3 * column + kind) + 1;
          values[COLUMNS * row + column] = bits;
          broken.add(row);
        });
      }
      // Nothing at all, and variances below zero.
      for (const [row, bits] of [
        [200, 0],
        [203, dtype === 'float16' ? 0xbc00 : 0xbf800000],
      ]) {
        values.fill(bits, COLUMNS * row + 3, COLUMNS * row + 9);
        broken.add(row);
      }
      const { geometry } = await ingestOnGpu(bench, { layout, tensors: { gaussians: words } });
      for (let row = 0; row < read.count; row++) {
        check(
          isNothing(geometry, row) === broken.has(row),
          `${dtype}: row ${row} is ${broken.has(row) ? 'kept' : 'lost'}`,
        );
      }
    }
  },
};

const counted: StageCase = {
  name: 'ingest: the count on the GPU decides, for any value, and rows behind it are not drawn',
  async run(bench) {
    const { cloud } = smallRoom();
    const { layout, tensors } = writeTensors(cloud, PLAIN);
    const garbage = new Uint32Array(tensors.gaussians).fill(0x7fc00000, COLUMNS * 300);
    const withCount: GaussianLayout = { ...layout, count: 'count' };
    for (const [count, living] of [
      [300, 300],
      [0, 0],
      [1, 1],
      [-5, 0],
      [2 ** 31 - 1, 400],
    ]) {
      const run = { layout: withCount, tensors: { gaussians: garbage, count: Uint32Array.of(count, 0, 0, 0) } };
      const { geometry, chunks } = await ingestOnGpu(bench, run, 400);
      for (let row = 0; row < cloud.count; row++) {
        // Opacity 0 with an extent: neither drawn nor counted as a fault.
        const isDead = !isNothing(geometry, row) && shapeOf(geometry, row)[6] === 0;
        check(isDead === row >= living, `count ${count}: row ${row} ${isDead ? 'is dead' : 'lives'}`);
      }
      const empty = Math.ceil(living / constants.CULL_GROUP);
      check(chunks[8 * empty] > chunks[8 * empty + 4], `count ${count}: chunk ${empty} is not turned inside out`);
    }
  },
};

const paged: StageCase = {
  name: 'ingest: more rows than a buffer binds are spread over pages',
  async run(bench) {
    const { cloud } = smallRoom();
    const { layout, tensors } = writeTensors(cloud, SPECS['split, scales']);
    const whole = await ingestOnGpu(bench, { layout, tensors });
    // A device that binds no more than 512 rows of the widest tensor at once.
    const rowBytes = 4 * Math.max(...layout.attributes.map(({ rowStride }) => rowStride));
    const limit = 512 * Math.max(rowBytes, 32, 4 * shWords(layout.shDegree ?? 0, 'float16'));
    const small = withBufferLimit(bench.device, limit);
    const gaussians = await DynamicGaussians.create(small, layout);
    const buffers = Object.entries(tensors).map(([name, words]) => [name, bench.buffer(words)] as const);
    gaussians.ingest(Object.fromEntries(buffers), layout.capacity);
    check(gaussians.blocks.length === Math.ceil(cloud.count / 512), `${gaussians.blocks.length} pages`);
    let first = 0;
    for (const page of gaussians.blocks) {
      const geometry = await bench.read(page.geometry, 32 * page.count);
      checkEqual(geometry, whole.geometry.subarray(8 * first, 8 * (first + page.count)), `page from row ${first}`);
      first += page.count;
    }
    gaussians.destroy();
  },
};

const ofInstances: StageCase = {
  name: 'ingest: of several scenes in the same tensors each takes its own rows and its own count, wherever they begin',
  async run(bench) {
    const { cloud } = smallRoom();
    // Odd, so that no slice starts at a valid offset of a binding.
    const rows = 1333;
    for (const what of ['packed, covariances, colors', 'split, scales']) {
      for (const dtype of ['float32', 'float16'] as const) {
        const { layout, tensors } = writeTensors(cloud, { ...SPECS[what], dtype });
        const whole = await ingestOnGpu(bench, { layout, tensors });
        const buffers = Object.entries(tensors).map(([name, words]) => [name, bench.buffer(words)] as const);
        const counts = bench.buffer(Uint32Array.of(7, rows, 1000, rows));
        const gaussians = await DynamicGaussians.create(bench.device, { ...layout, capacity: rows, count: 'count' });
        for (const [instance, living] of [
          [3, rows],
          [0, 7],
          [2, 1000],
        ]) {
          gaussians.ingest({ ...Object.fromEntries(buffers), count: counts }, rows, instance);
          const [page] = gaussians.blocks;
          const geometry = (await bench.read(page.geometry)).subarray(0, 8 * living);
          const harmonics = whole.sh.length / cloud.count;
          const sh = (await bench.read(page.sh)).subarray(0, harmonics * living);
          const first = instance * rows;
          const name = `${what}, ${dtype}, scene ${instance}`;
          checkEqual(geometry, whole.geometry.subarray(8 * first, 8 * (first + living)), name);
          checkEqual(sh, whole.sh.subarray(harmonics * first, harmonics * (first + living)), `${name}, harmonics`);
        }
        let refusal = '';
        try {
          gaussians.ingest({ ...Object.fromEntries(buffers), count: counts }, rows, 30);
        } catch (error) {
          refusal = (error as { code?: string }).code ?? '';
        }
        check(refusal === 'argument/value', `rows that are not there: ${refusal}`);
        gaussians.destroy();
      }
    }
  },
};

export const ingestCases: readonly StageCase[] = [...againstTwin, hostile, counted, paged, ofInstances];
