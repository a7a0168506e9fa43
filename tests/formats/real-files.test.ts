/** Real files, each format against the same scene in the others. */
import assert from 'node:assert/strict';
import { before, describe, test } from 'node:test';
import { readScene } from '@gaussian-splat/formats';
import type { GaussianCloud } from '@gaussian-splat/core';
import { halfTurned, needsSharedData, sharedFile } from '../support/data.js';
import {
  assertAtMost,
  assertSameCloud,
  coefficient,
  largestDifference,
  largestRotationError,
} from './support/expect.js';

const read = (name: string): Promise<GaussianCloud> => readScene(sharedFile(name), { name });
const logarithms = (values: Float32Array): number[] => Array.from(values, Math.log);

describe('one captured scene in seven files', { skip: needsSharedData }, () => {
  let ply: GaussianCloud;
  before(async () => {
    ply = await read('formats/playbot3.ply');
  });

  test('PLY: all splats, degree 2', () => {
    assert.deepEqual([ply.count, ply.shDegree, ply.droppedCount, ply.antialiased], [31_000, 2, 0, false]);
  });

  test('PLY of degree 0 differs in nothing but the degree', async () => {
    const flat = await read('formats/playbot3.sh0.ply');
    assert.equal(flat.shDegree, 0);
    assertSameCloud(flat, { ...ply, shDegree: 0, sh: coefficient(ply, 0) });
  });

  for (const [file, rotationBound] of [
    ['niantic-v2', 4.8e-3],
    // 1.6e-6 for the bits of the format, the rest for the float32 numbers of both clouds.
    ['niantic-v3', 1.7e-6],
    ['niantic-v4', 1.7e-6],
    ['pc-v4', 1.7e-6],
  ] as const) {
    test(`SPZ ${file}: every attribute to the bits of the format`, async () => {
      const spz = halfTurned(await read(`formats/playbot3.${file}.spz`));
      assert.deepEqual([spz.count, spz.shDegree, spz.droppedCount, spz.antialiased], [31_000, 2, 0, false]);
      assertAtMost(largestDifference(spz.positions, ply.positions), 1.23e-4, 'positions: half of 1/4096');
      assertAtMost(largestRotationError(spz, ply), rotationBound, 'rotations');
      assertAtMost(largestDifference(spz.opacities, ply.opacities), 0.5 / 255 + 1e-6, 'opacities: half a byte');
      assertScales(spz, ply);
      assertColors(spz, ply);
    });
  }

  test('all SPZ files of this scene agree where their bits are the same', async () => {
    const [v2, v3, v4, playcanvas] = await Promise.all(
      ['niantic-v2', 'niantic-v3', 'niantic-v4', 'pc-v4'].map((name) => read(`formats/playbot3.${name}.spz`)),
    );
    assertSameCloud(v4, v3);
    assertSameCloud({ ...v2, rotations: v3.rotations }, v3);
    assertAtMost(largestDifference(playcanvas.positions, v4.positions), 1 / 4096, 'positions');
  });

  test('compressed PLY: every splat has its counterpart', async () => {
    const compressed = await read('formats/playbot3.compressed.ply');
    assert.deepEqual([compressed.count, compressed.shDegree, compressed.droppedCount], [31_000, 2, 0]);
    const pairs = matchByPosition(compressed, ply);
    const share = pairs.filter(([a, b]) => isCounterpart(compressed, a, ply, b)).length / pairs.length;
    // If several splats lie within one step of the position, the nearest need not be the same.
    assert.ok(share > 0.97, `${share} of the splats are where and as they were`);
  });
});

/** Scales below exp(-10) and above exp(5.9) are out of the format's range; the rest lie within half a step of 1/16. */
function assertScales(spz: GaussianCloud, ply: GaussianCloud): void {
  const clamped = logarithms(ply.scales).map((value) => Math.min(5.9375, Math.max(-10, value)));
  assertAtMost(largestDifference(logarithms(spz.scales), clamped), 1 / 32 + 1e-5, 'scales');
}

/**
 * Half a step, with values clamped to the format's range: constant terms ±1/0.3 in 255 steps, others -1..127/128 in
 * steps of 1/128, and Niantic's packer keeps 5 bits for degree 1 and 4 bits above.
 */
function assertColors(spz: GaussianCloud, ply: GaussianCloud): void {
  for (let k = 0; k < 9; k++) {
    const [low, high] = k === 0 ? [-1 / 0.3, 1 / 0.3] : [-1, 127 / 128];
    const bound = k === 0 ? 0.5 / 255 / 0.15 : (k < 4 ? 4.5 : 8.5) / 128;
    const clamped = coefficient(ply, k).map((value) => Math.min(high, Math.max(low, value)));
    const error = largestDifference(coefficient(spz, k), clamped);
    assert.ok(error <= bound + 1e-6, `coefficient ${k}: ${error}`);
  }
}

/** For every splat of `a`, the nearest of `b`, by way of a grid whose cells are larger than a step of `a`. */
function matchByPosition(a: GaussianCloud, b: GaussianCloud): [number, number][] {
  const cell = 0.05;
  const key = (x: number, y: number, z: number) =>
    `${Math.floor(x / cell)},${Math.floor(y / cell)},${Math.floor(z / cell)}`;
  const grid = new Map<string, number[]>();
  for (let i = 0; i < b.count; i++) {
    const [x, y, z] = b.positions.subarray(3 * i, 3 * i + 3);
    const k = key(x, y, z);
    if (!grid.has(k)) grid.set(k, []);
    grid.get(k)?.push(i);
  }
  return Array.from({ length: a.count }, (_, i) => {
    const [x, y, z] = a.positions.subarray(3 * i, 3 * i + 3);
    let nearest = 0;
    let distance = Infinity;
    for (let n = 0; n < 27; n++) {
      const offset = [(n % 3) - 1, (Math.floor(n / 3) % 3) - 1, Math.floor(n / 9) - 1].map((step) => step * cell);
      for (const j of grid.get(key(x + offset[0], y + offset[1], z + offset[2])) ?? []) {
        const d = Math.hypot(b.positions[3 * j] - x, b.positions[3 * j + 1] - y, b.positions[3 * j + 2] - z);
        if (d < distance) [nearest, distance] = [j, d];
      }
    }
    return [i, nearest];
  });
}

/** Within the steps of the compressed format, for chunks of the size that this scene has. */
function isCounterpart(a: GaussianCloud, i: number, b: GaussianCloud, j: number): boolean {
  const within = (x: Float32Array, y: Float32Array, width: number, bound: number): boolean =>
    x.subarray(width * i, width * (i + 1)).every((value, k) => Math.abs(value - y[width * j + k]) <= bound);
  const ratios = [0, 1, 2].map((k) => Math.log(a.scales[3 * i + k] / b.scales[3 * j + k]));
  let dot = 0;
  for (let k = 0; k < 4; k++) dot += a.rotations[4 * i + k] * b.rotations[4 * j + k];
  return (
    within(a.positions, b.positions, 3, 0.01) &&
    ratios.every((ratio) => Math.abs(ratio) <= 0.02) &&
    within(a.opacities, b.opacities, 1, 0.003) &&
    within(a.sh, b.sh, 27, 0.04) &&
    1 - Math.abs(dot) < 1e-5
  );
}

describe('other real files', { skip: needsSharedData }, () => {
  test('the same three splats as PLY, SPZ and .splat', async () => {
    const name = 'cases/metalsplatter/test-splat.3-points-from-train';
    const [ply, spz, splat] = await Promise.all(
      ['ply', 'spz', 'splat'].map((extension) => read(`${name}.${extension}`)),
    );
    assert.deepEqual([ply.count, ply.shDegree], [3, 3]);
    assert.deepEqual([spz.count, spz.shDegree], [3, 3]);
    assert.deepEqual([splat.count, splat.shDegree], [3, 0]);
    halfTurned(spz);
    assertAtMost(largestDifference(spz.positions, ply.positions), 1.23e-4, 'positions of SPZ');
    assertAtMost(largestRotationError(spz, ply), 1.6e-6, 'rotations of SPZ');
    assertAtMost(largestDifference(logarithms(spz.scales), logarithms(ply.scales)), 1 / 32 + 1e-5, 'scales of SPZ');
    for (let k = 1; k < 16; k++) {
      const error = largestDifference(coefficient(spz, k), coefficient(ply, k));
      assert.ok(error <= (k < 4 ? 4.5 : 8.5) / 128 + 1e-6, `coefficient ${k}: ${error}`);
    }
    assert.equal(largestDifference(splat.positions, ply.positions), 0);
    assertAtMost(largestDifference(splat.scales, ply.scales), 1e-7, 'scales of .splat');
    assertAtMost(largestRotationError(splat, ply), 1e-3, 'rotations of .splat');
    assertAtMost(largestDifference(splat.opacities, ply.opacities), 1 / 255, 'opacities of .splat');
    const clamped = coefficient(ply, 0).map((v) => Math.min(1.7725, Math.max(-1.7725, v)));
    assertAtMost(largestDifference(splat.sh, clamped), 1 / 255 / 0.282 + 1e-3, 'rotations of .splat');
  });

  const folder = 'cases/splat-transform-fixtures';

  test('the minimal SPZ files of a peer: gzip and plain are one scene, v3 and v4 another', async () => {
    const [raw, v2, v3, v4] = await Promise.all(
      ['-raw', '-v2', '-v3', '-v4'].map((kind) => read(`${folder}/minimal${kind}.spz`)),
    );
    assertSameCloud(raw, v2);
    assertSameCloud(v3, v4);
    assert.equal(raw.count, 4);
    assert.deepEqual(Array.from(v3.positions, Math.abs), [1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0, 0]);
    for (const opacity of raw.opacities) assertAtMost(Math.abs(opacity - 0.9), 0.003, 'opacity 0.9');
    for (const scale of raw.scales) assertAtMost(Math.abs(scale / 0.1 - 1), 0.04, 'scale 0.1');
  });

  test('the minimal .ksplat and .splat of a peer are one scene', async () => {
    const [ksplat, splat] = await Promise.all(['ksplat', 'splat'].map((kind) => read(`${folder}/minimal.${kind}`)));
    assert.deepEqual([ksplat.count, splat.count], [4, 4]);
    assertAtMost(largestDifference(ksplat.positions, splat.positions), 0, 'positions');
    assertAtMost(largestDifference(ksplat.scales, splat.scales), 0, 'scales');
    assertAtMost(largestDifference(ksplat.opacities, splat.opacities), 0, 'opacities');
    assertAtMost(largestDifference(ksplat.sh, splat.sh), 0, 'colors');
  });

  test('bytes after the last splat are left alone', async () => {
    const cloud = await read('cases/cvlab/pc_short.ply');
    assert.deepEqual([cloud.count, cloud.shDegree, cloud.droppedCount], [100, 3, 0]);
  });

  for (const [file, count, degree] of [
    ['scenes/skull.ply', 100_000, 3],
    ['scenes/plant.splat', 14_007, 0],
    ['scenes/angel.compressed.ply', 71_377, 0],
    ['avatars/head/p2-1/offset.ply', 20_018, 0],
  ] as const) {
    test(`${file}: all ${count} splats are usable`, async () => {
      const cloud = await read(file);
      assert.deepEqual([cloud.count, cloud.shDegree, cloud.droppedCount], [count, degree, 0]);
    });
  }

  test('skull.ply against a parser that has no code in common with the reader', async () => {
    const bytes = sharedFile('scenes/skull.ply');
    const cloud = await readScene(bytes);
    const header = Buffer.from(bytes.subarray(0, 4096)).toString('latin1').split('end_header\n')[0];
    const names = [...header.matchAll(/property float (\w+)/g)].map(([, name]) => name);
    const view = new DataView(bytes.buffer, bytes.byteOffset + header.length + 'end_header\n'.length);
    const value = (i: number, name: string) => view.getFloat32(4 * (names.length * i + names.indexOf(name)), true);
    for (let i = 0; i < cloud.count; i += 997) {
      assert.equal(cloud.positions[3 * i + 1], value(i, 'y'));
      assert.ok(Math.abs(cloud.scales[3 * i + 2] / Math.exp(value(i, 'scale_2')) - 1) < 1e-6);
      assert.ok(Math.abs(cloud.opacities[i] - 1 / (1 + Math.exp(-value(i, 'opacity')))) < 1e-6);
      assert.equal(cloud.sh[48 * i + 2], value(i, 'f_dc_2'));
      assert.equal(cloud.sh[48 * i + 3 * 1 + 0], value(i, 'f_rest_0'), 'first red coefficient');
      assert.equal(cloud.sh[48 * i + 3 * 15 + 2], value(i, 'f_rest_44'), 'last blue coefficient');
      assert.equal(cloud.sh[48 * i + 3 * 4 + 1], value(i, 'f_rest_18'), 'fourth green coefficient');
    }
  });
});
