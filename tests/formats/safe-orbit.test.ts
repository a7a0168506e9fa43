/** Limits of an orbiting camera in SPZ (extension 0xADBE0002) and PLY, as Niantic's library defines them. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { encodingsFor } from '@gaussian-splat/optimize';
import { readScene } from '@gaussian-splat/formats';
import { buildGltf, writeGlb } from './support/gltf-writer.js';
import { writePly, type PlyWriterElement } from './support/ply-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { inriaColumns, rawSplats } from './support/splats.js';
import { extensionRecord, writeSpz } from './support/spz-writer.js';

const SPLATS = rawSplats(20, 1);
type Orbit = readonly [lowest: number, highest: number, radius: number];
const LIMITED: Orbit = [-0.25, 0.5, 1.5];

const record = (values: readonly number[]): Uint8Array =>
  extensionRecord(0xadbe0002, new Uint8Array(Float32Array.from(values).buffer));
const spz = (values: readonly number[], version: 2 | 3 | 4 = 4): Uint8Array =>
  writeSpz(SPLATS, { version, extensions: record(values) });
const element = (name: string, values: readonly number[]): PlyWriterElement => ({
  name,
  columns: [{ name, type: 'float', values }],
});
const ply = ([lowest, highest, radius]: Orbit): Uint8Array =>
  writePly([
    { name: 'vertex', columns: inriaColumns(SPLATS) },
    element('safe_orbit_camera_elevation_min_max_radians', [lowest, highest]),
    element('safe_orbit_camera_radius_min', [radius]),
  ]);

/** Warnings without the one that the axes of an SPZ are assumed. */
const othersOf = (warnings: readonly string[] = []): readonly string[] =>
  warnings.filter((sentence) => !/does not name its axes/.test(sentence));

function assertLimited({ hints, warnings }: GaussianCloud): void {
  const { minPhi = NaN, maxPhi = NaN, minRadius } = hints?.orbit ?? {};
  assert.ok(Math.abs(minPhi - (Math.PI / 2 - 0.5)) < 1e-6, `minPhi ${minPhi}`);
  assert.ok(Math.abs(maxPhi - (Math.PI / 2 + 0.25)) < 1e-6, `maxPhi ${maxPhi}`);
  assert.equal(minRadius, 1.5);
  assert.deepEqual(othersOf(warnings), []);
}

test('elevations above the horizon become polar angles', async () => {
  for (const version of [2, 3, 4] as const) assertLimited(await readScene(spz(LIMITED, version), { name: 'a.spz' }));
  assertLimited(await readScene(ply(LIMITED), { name: 'a.ply' }));
});

test('zeros, the defaults of the extension, are no limits', async () => {
  for (const [bytes, name] of [
    [spz([0, 0, 0]), 'a.spz'],
    [ply([0, 0, 0]), 'a.ply'],
  ] as const) {
    const { hints, warnings } = await readScene(bytes, { name });
    assert.deepEqual(hints?.orbit, {});
    assert.deepEqual(othersOf(warnings), []);
  }
  assert.deepEqual((await readScene(spz([0, 0, 2]))).hints?.orbit, { minRadius: 2 });
});

test('values that are no limits, and cut records, are left out with a warning', async () => {
  for (const values of [
    [1, -1, 0],
    [NaN, 1, 0],
    [-1, 2, 0],
    [-1, 1, -3],
    [-1, 1, Infinity],
  ] as const) {
    const wrong = await readScene(spz(values));
    assert.equal(wrong.hints?.orbit, undefined);
    assert.deepEqual(othersOf(wrong.warnings), ['The SPZ extension 0xadbe0002 is left out.'], String(values));
    assert.match(
      (await readScene(ply(values), { name: 'a.ply' })).warnings![0],
      /^The limits of the camera are left out/,
    );
  }
  const cut = writeSpz(SPLATS, { version: 4, extensions: record(LIMITED).subarray(0, 16) });
  assert.deepEqual(othersOf((await readScene(cut)).warnings), ['The SPZ extension 0xadbe0002 is left out.']);
});

test('within a glTF, whose nodes may scale the splats, they are left out with a warning', async () => {
  const parts = buildGltf([[{ cloud: smallCloud(1, 0), spz: spz(LIMITED, 3) }]], [{ mesh: 0 }], [0]);
  const { hints, warnings } = await readScene(writeGlb(parts.json, parts.buffer), { name: 'a.glb' });
  assert.equal(hints?.orbit, undefined);
  assert.ok(warnings?.includes('The SPZ extension 0xadbe0002 is left out.'), String(warnings));
});

test('SPZ and PLY that are written have the limits of their source', async () => {
  const cloud = await readScene(spz(LIMITED));
  for (const name of ['a.spz', 'a.ply']) {
    const degrees = new Uint8Array(cloud.count).fill(1);
    const bytes = await encodingsFor(name, cloud).at(-1)!.write({ cloud, degrees });
    assertLimited(await readScene(bytes, { name }));
  }
});

test('other elements of a PLY are named; those of SHARP that do not affect splats are not', async () => {
  const read = async (...names: string[]): Promise<readonly string[]> => {
    const vertex = { name: 'vertex', columns: inriaColumns(SPLATS) };
    const file = writePly([vertex, ...names.map((name) => element(name, [1, 2]))]);
    return (await readScene(file, { name: 'a.ply' })).warnings ?? [];
  };
  assert.deepEqual(await read('extrinsic', 'intrinsic', 'image_size'), []);
  assert.deepEqual(await read('extrinsic', 'light'), ['Elements that are not known are left out: light.']);
});
