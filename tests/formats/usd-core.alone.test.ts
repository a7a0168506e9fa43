/** OpenUSD against usd-core of PyPI, by the Python of `npm run test:exporter` or of `USD_PYTHON`: 200 random stages, and files that `optimize` and `page` write. */
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import {
  matrixOfQuaternion,
  orthogonalFactor,
  type GaussianCloud,
  type ShDegree,
  type Vector3,
} from '@gaussian-splat/core';
import { encodingsFor } from '@gaussian-splat/optimize';
import { fewerSplats } from '@gaussian-splat/optimize/pages';
import { readScene } from '@gaussian-splat/formats';
import { shBasis } from '../oracle/sh.js';
import { needsSharedData, sharedFile } from '../support/data.js';
import { assertAtMost, largestDifference } from './support/expect.js';

const script = fileURLToPath(new URL('support/usd_stages.py', import.meta.url));
const root = fileURLToPath(new URL('../../', import.meta.url));
const python = [process.env.USD_PYTHON ?? '', join(root, '.cache/exporter/cpu/bin/python')].find(
  (path) => existsSync(path) && spawnSync(path, ['-c', 'import pxr.UsdValidation']).status === 0,
);
const skip =
  python === undefined && 'usd-core not found: npm run test:exporter installs it, or USD_PYTHON names a Python';

/** Splats of a prim as usd-core evaluates them. `matrix`: [4, 4] for row vectors, to the coordinates of the stage. */
interface Field {
  readonly count: number;
  readonly degree: ShDegree;
  readonly matrix: readonly number[];
  readonly positions: readonly number[];
  readonly scales: readonly number[];
  readonly rotations: readonly number[];
  readonly opacities: readonly number[];
  readonly sh: readonly number[];
  readonly order: string;
}

interface Stage {
  readonly file: string;
  readonly up: 'Y' | 'Z';
  readonly meters: number | null;
  /** Attribution and license. */
  readonly credits: readonly (string | null)[];
  readonly fields: readonly Field[];
}

const DIRECTIONS: readonly Vector3[] = [
  [0.36, 0.48, 0.8],
  [-0.6, 0, 0.8],
  [0, -0.8, -0.6],
];
const ORDERS: Readonly<Record<string, string>> = { cameraDistance: 'distance', rayHitDistance: 'pixel' };

/** Covariance of a splat, [3, 3]: R·S²·Rᵀ of its axes, the columns of a matrix. */
const covarianceOf = (axes: readonly number[]): number[] =>
  Array.from({ length: 9 }, (_, k) => {
    const [row, column] = [3 * Math.floor(k / 3), 3 * (k % 3)];
    return [0, 1, 2].reduce((sum, n) => sum + axes[row + n] * axes[column + n], 0);
  });

function axesOf(quaternion: ArrayLike<number>, scales: ArrayLike<number>): number[] {
  const norm = Math.hypot(quaternion[0], quaternion[1], quaternion[2], quaternion[3]);
  const [w, x, y, z] = Array.from(quaternion, (value) => value / norm);
  return matrixOfQuaternion(w, x, y, z).map((value, k) => value * scales[k % 3]);
}

function colorOf(sh: ArrayLike<number>, at: number, degree: ShDegree, direction: Vector3): number[] {
  const basis = shBasis(degree, direction);
  return [0, 1, 2].map((c) => basis.reduce((sum, value, k) => sum + value * sh[at + 3 * k + c], 0));
}

/** Asserts that splats from `first` of a cloud are those of a field, each number within 1e-6 of the largest one of its splat. */
function assertField(cloud: GaussianCloud, first: number, field: Field, where: string): void {
  const m = field.matrix;
  // For column vectors.
  const linear = [0, 1, 2].flatMap((row) => [0, 1, 2].map((column) => m[4 * column + row]));
  const scale = Math.cbrt(Math.abs(determinantOf(linear)));
  const turn = orthogonalFactor(linear);
  const isSimilar = linear.every((value, k) => Math.abs(value - scale * turn[k]) <= 1e-9 * scale);
  const near = (found: readonly number[], expected: readonly number[], floor: number, what: string): void => {
    const size = Math.max(floor, ...expected.map(Math.abs));
    found.forEach((value, k) => assertAtMost(Math.abs(value - expected[k]), 1e-6 * size, `${where}, ${what} ${k}`));
  };
  const own = 3 * (field.degree + 1) ** 2;
  const stride = 3 * (cloud.shDegree + 1) ** 2;
  for (let i = 0; i < field.count; i++) {
    const n = first + i;
    const [x, y, z] = field.positions.slice(3 * i, 3 * i + 3);
    const place = [0, 1, 2].map((c) => x * m[c] + y * m[4 + c] + z * m[8 + c] + m[12 + c]);
    const found = [0, 1, 2].map((c) => cloud.origin[c] + cloud.positions[3 * n + c]);
    near(found, place, 9, `splat ${i}, position`);
    const axes = axesOf(field.rotations.slice(4 * i, 4 * i + 4), field.scales.slice(3 * i, 3 * i + 3));
    const moved = Array.from({ length: 9 }, (_, k) => {
      const [row, column] = [3 * Math.floor(k / 3), k % 3];
      return linear[row] * axes[column] + linear[row + 1] * axes[3 + column] + linear[row + 2] * axes[6 + column];
    });
    const ours = axesOf(cloud.rotations.subarray(4 * n, 4 * n + 4), cloud.scales.subarray(3 * n, 3 * n + 3));
    near(covarianceOf(ours), covarianceOf(moved), 0, `splat ${i}, covariance`);
    near([cloud.opacities[n]], [field.opacities[i]], 1, `splat ${i}, opacity`);
    if (!isSimilar) continue;
    for (const d of DIRECTIONS) {
      const local = [0, 1, 2].map((c) => turn[c] * d[0] + turn[3 + c] * d[1] + turn[6 + c] * d[2]);
      const expected = colorOf(field.sh, own * i, field.degree, local as unknown as Vector3);
      near(colorOf(cloud.sh, stride * n, cloud.shDegree, d), expected, 4, `splat ${i}, color`);
    }
  }
}

const determinantOf = (m: readonly number[]): number =>
  m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);

async function assertStage(folder: string, { file, up, meters, credits, fields }: Stage): Promise<number> {
  const bytes = readFileSync(join(folder, file));
  const count = fields.reduce((sum, field) => sum + field.count, 0);
  if (count === 0) {
    const error: unknown = await readScene(bytes, { name: file }).catch((found: unknown) => found);
    assert.match(String(error), /0 splats|ParticleField3DGaussianSplat/, file);
    return 0;
  }
  const cloud = await readScene(bytes, { name: file });
  assert.equal(cloud.count, count, file);
  assert.deepEqual(cloud.hints?.up, up === 'Y' ? [0, 1, 0] : [0, 0, 1], file);
  assert.equal(cloud.hints?.metersPerUnit ?? null, meters, file);
  const { attribution = null, license = null } = cloud.hints?.credits ?? {};
  assert.deepEqual([attribution, license], credits, file);
  const largest = fields.reduce((max, field) => (field.count > max.count ? field : max));
  assert.equal(cloud.hints?.order, ORDERS[largest.order], file);
  let first = 0;
  for (const field of fields) {
    assertField(cloud, first, field, file);
    first += field.count;
  }
  return count;
}

test('200 random stages are as usd-core reads them, within 1e-6', { skip }, async (context) => {
  const folder = mkdtempSync(join(tmpdir(), 'usd-'));
  try {
    execFileSync(python!, [script, 'write', folder, '200', String(process.env.SEED ?? 1)], { stdio: 'pipe' });
    const stages = JSON.parse(readFileSync(join(folder, 'expected.json'), 'utf8')) as Stage[];
    let splats = 0;
    for (const stage of stages) splats += await assertStage(folder, stage);
    context.diagnostic(`${stages.length} stages, ${splats} splats`);
    assert.ok(splats > 5_000, `${splats} splats`);
  } finally {
    rmSync(folder, { recursive: true });
  }
});

/** Captured scenes of the repository, of up to 450,000 splats. */
const CAPTURES = ['apartment', 'garden', 'hall', 'product', 'walker'];
const MAX_ON_PHONES = 200_000;

test(
  '`page --usdz` writes five captures for phones as usd-core accepts them, within 1e-6',
  { skip },
  async (context) => {
    const folder = mkdtempSync(join(tmpdir(), 'usd-'));
    try {
      const sources = CAPTURES.map((name) => join(root, `demo/scenes/studio/${name}.spz`));
      const command = [join(root, 'packages/cli/bin/gaussian-splat.mjs'), 'page', ...sources, folder];
      execFileSync(process.execPath, [...command, '--no-serve', '--usdz'], { stdio: 'pipe' });
      const files = CAPTURES.map((name) => join(folder, `${name}-ar.usdz`));
      const output = execFileSync(python!, [script, 'dump', ...files], { encoding: 'utf8' });
      const stages = JSON.parse(output) as { up: string; degree: ShDegree; faults: readonly string[] }[];
      for (const [k, { up, degree, faults }] of stages.entries()) {
        assert.deepEqual(faults, [], CAPTURES[k]);
        const whole = await readScene(readFileSync(sources[k]), { name: sources[k] });
        const cloud = fewerSplats(whole, MAX_ON_PHONES);
        const kept = Math.min(whole.count, MAX_ON_PHONES);
        assert.deepEqual([cloud.count, degree, cloud.hints?.up ?? [0, -1, 0]], [kept, whole.shDegree, [0, -1, 0]]);
        assert.equal(up, 'Y', 'the stage is turned by half a turn about x');
        const numbers = (name: string): Float32Array => {
          const { buffer, byteOffset, length } = readFileSync(join(folder, `${CAPTURES[k]}-ar.${name}`));
          return new Float32Array(buffer.slice(byteOffset, byteOffset + length));
        };
        const [positions, scales, turns, opacities, sh] = [
          ...['positions', 'scales', 'orientations', 'opacities', 'sphericalHarmonicsCoefficients'].map(numbers),
        ];
        const places = cloud.positions.map((value, i) => (i % 3 === 0 ? value : -value));
        const stride = 3 * (degree + 1) ** 2;
        const [d, turned] = [DIRECTIONS[0], [DIRECTIONS[0][0], -DIRECTIONS[0][1], -DIRECTIONS[0][2]] as const];
        const colors = Float64Array.from(
          { length: cloud.count },
          (_, i) => colorOf(cloud.sh, stride * i, degree, d)[1],
        );
        const found = colors.map((_, i) => colorOf(sh, stride * i, degree, turned)[1]);
        // Half a turn, (0, 1, 0, 0), times (w, x, y, z) is (-x, w, -z, y); the real part is stored last.
        const expected = new Float32Array(4 * cloud.count);
        for (let i = 0; i < expected.length; i += 4) {
          const [w, x, y, z] = cloud.rotations.subarray(i, i + 4);
          expected.set([w, -z, y, -x], i);
        }
        const differences = {
          positions: largestDifference(positions, places),
          scales: largestDifference(scales, cloud.scales),
          rotations: largestDifference(turns, expected),
          opacities: largestDifference(opacities, cloud.opacities),
          colors: largestDifference(found, colors),
        };
        for (const [what, value] of Object.entries(differences)) assertAtMost(value, 1e-6, `${CAPTURES[k]}, ${what}`);
        context.diagnostic(`${CAPTURES[k]}: ${cloud.count} of ${whole.count} splats, ${JSON.stringify(differences)}`);
      }
    } finally {
      rmSync(folder, { recursive: true });
    }
  },
);

/** Scenes of the shared data. The test takes a few thousand splats of each. */
const SCENES = ['skull.ply', 'angel.compressed.ply', 'massa.sog', 'st-peter.sog', 'plant.splat'];
const MAX_SPLATS = 3_000;
const CREDITS = { attribution: 'Museum; Łódź "A"', license: 'CC-BY-4.0' };

test(
  'five scenes are written as usd-core accepts them, and return from its layers',
  { skip: skip || needsSharedData },
  async (context) => {
    const folder = mkdtempSync(join(tmpdir(), 'usd-'));
    try {
      const clouds = new Map<string, GaussianCloud>();
      for (const scene of SCENES) {
        const whole = await readScene(sharedFile(`scenes/${scene}`), { name: scene });
        const cloud = sampled(whole, MAX_SPLATS);
        const degrees = new Uint8Array(cloud.count).fill(cloud.shDegree);
        for (const suffix of ['.usdz', '.usdc']) {
          for (const [k, encoding] of encodingsFor(`a${suffix}`).entries()) {
            const file = `${scene.replace(/\..*/, '')}${k}${suffix}`;
            writeFileSync(join(folder, file), await encoding.write({ cloud, degrees }));
            clouds.set(file, cloud);
          }
        }
      }
      const files = [...clouds.keys()].map((file) => join(folder, file));
      const output = execFileSync(python!, [script, 'read', ...files], { maxBuffer: 2 ** 30, encoding: 'utf8' });
      for (const stage of JSON.parse(output) as (Stage & { readonly faults: readonly string[] })[]) {
        const cloud = clouds.get(stage.file)!;
        assert.deepEqual(stage.faults, [], stage.file);
        assert.equal(stage.fields[0].count, cloud.count, stage.file);
        assert.deepEqual(stage.credits, Object.values(CREDITS), stage.file);
        await assertStage(folder, stage);
        // The values of float32 are those of the scene, which is turned by half a turn about x.
        if (stage.file.includes('1.usd')) {
          const places = cloud.positions.map((value, k) => (k % 3 === 0 ? value : -value));
          assertAtMost(largestDifference(stage.fields[0].positions, places), 0, `${stage.file}, positions`);
          assertAtMost(largestDifference(stage.fields[0].opacities, cloud.opacities), 0, `${stage.file}, opacities`);
        }
        for (const suffix of ['.usda', '.usdc'])
          await assertStage(folder, { ...stage, file: `again-${stage.file.replace(/\.\w+$/, suffix)}` });
      }
      context.diagnostic(`${files.length} files of ${SCENES.length} scenes`);
    } finally {
      rmSync(folder, { recursive: true });
    }
  },
);

/** Every n-th splat of a cloud, at most `max`. */
function sampled(cloud: GaussianCloud, max: number): GaussianCloud {
  const step = Math.ceil(cloud.count / max);
  const count = Math.floor(cloud.count / step);
  const rows = (values: Float32Array): Float32Array => {
    const width = values.length / cloud.count;
    return Float32Array.from(
      { length: width * count },
      (_, k) => values[width * step * Math.floor(k / width) + (k % width)],
    );
  };
  const { positions, scales, rotations, opacities, sh } = cloud;
  return {
    ...{ ...cloud, count, hints: { credits: CREDITS }, positions: rows(positions), scales: rows(scales) },
    ...{ rotations: rows(rotations), opacities: rows(opacities), sh: rows(sh) },
  };
}
