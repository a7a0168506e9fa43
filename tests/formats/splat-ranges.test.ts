/** Reading a scene a few splats at a time, as threads do that divide the work: together they equal a single read. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { readScene, readSplats, splatRanges } from '@gaussian-splat/formats';
import { assertSameNumbers } from './support/expect.js';
import { buildGltf, writeGlb } from './support/gltf-writer.js';
import { writePly, type PlyColumn } from './support/ply-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { inriaColumns, rawSplats } from './support/splats.js';
import { writeSpz } from './support/spz-writer.js';

/** The places of a splat's numbers in the arrays of a cloud of a degree. */
function rowsOf({ count, positions, scales, rotations, opacities, sh }: GaussianCloud, coefficients: number): number[] {
  const own = sh.length / count;
  return Array.from({ length: count }, (_, i) => [
    ...positions.subarray(3 * i, 3 * i + 3),
    ...scales.subarray(3 * i, 3 * i + 3),
    ...rotations.subarray(4 * i, 4 * i + 4),
    opacities[i],
    ...Array.from({ length: 3 * coefficients }, (__, k) => (k < own ? sh[own * i + k] : 0)),
  ]).flat();
}

async function assertSameInRanges(bytes: Uint8Array, name: string, sizes: readonly number[]): Promise<void> {
  const whole = await readScene(bytes, { name });
  const ranges = (await splatRanges(bytes, name))!;
  assert.deepEqual([ranges.count, ranges.shDegree], [whole.count + whole.droppedCount, whole.shDegree]);
  const coefficients = (whole.shDegree + 1) ** 2;
  for (const size of sizes) {
    const rows: number[] = [];
    let dropped = 0;
    for (let first = 0; first < ranges.count; first += size) {
      const part = await readSplats(bytes, { first, end: Math.min(ranges.count, first + size) }, name);
      rows.push(...rowsOf(part, coefficients));
      dropped += part.droppedCount;
    }
    assert.equal(dropped, whole.droppedCount);
    assertSameNumbers(rows, rowsOf(whole, coefficients), `${size} at a time`);
  }
}

/** A PLY whose splats 3 and 8 cannot be drawn. */
function plyOf(degree: number, change: (column: PlyColumn) => PlyColumn = (column) => column): PlyColumn[] {
  return inriaColumns(rawSplats(20, degree)).map((column) =>
    change(
      column.name === 'x'
        ? { ...column, values: column.values.map((value, i) => (i === 3 || i === 8 ? NaN : value)) }
        : column,
    ),
  );
}

for (const degree of [0, 1, 3, 4]) {
  test(`PLY of degree ${degree}`, async () => {
    const header = { name: 'camera', columns: [{ name: 'f', type: 'uchar' as const, values: [1, 2, 3] }] };
    const bytes = writePly([header, { name: 'vertex', columns: plyOf(degree) }]);
    await assertSameInRanges(bytes, 'a.ply', [20, 7, 1]);
  });
}

test('glTF whose primitives differ in degree, in several places', async () => {
  const [a, b, c] = [smallCloud(9, 3, 1), smallCloud(4, 0, 2), smallCloud(6, 1, 3)];
  a.scales.fill(NaN, 6, 9);
  const nodes = [
    { mesh: 0, rotation: [0.1, 0.7, -0.2, 0.678232998], translation: [1, 2, 3] },
    { mesh: 1, scale: [2, 2, 2] },
    { mesh: 0, translation: [10, 0, 0] },
  ];
  const { json, buffer } = buildGltf([[{ cloud: a }, { cloud: b }], [{ cloud: c }]], nodes, [0, 1, 2]);
  await assertSameInRanges(writeGlb(json, buffer), 'a.glb', [40, 11, 5, 1]);
});

test('glTF of drafts, whose attributes have other names', async () => {
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(9, 2) }]], [{ mesh: 0 }], [0]);
  const draft = JSON.parse(JSON.stringify(json).replaceAll('KHR_gaussian_splatting:', '_')) as Record<string, unknown>;
  await assertSameInRanges(writeGlb(draft, buffer), 'a.glb', [5, 1]);
});

test('what must be read whole is said to', async () => {
  const { json, buffer } = buildGltf(
    [[{ cloud: smallCloud(1, 0), spz: writeSpz(rawSplats(9, 1), { version: 2 }) }]],
    [{ mesh: 0 }],
    [0],
  );
  const list: PlyColumn = {
    name: 'ids',
    type: 'int',
    listCountType: 'uchar',
    values: plyOf(0)[0].values.map(() => [1]),
  };
  const doubles = plyOf(0, (column) => (column.name === 'y' ? { ...column, type: 'double' } : column));
  const files = {
    'compressed.glb': writeGlb(json, buffer),
    'text.ply': writePly([{ name: 'vertex', columns: plyOf(0) }], { encoding: 'ascii' }),
    'lists.ply': writePly([{ name: 'vertex', columns: [...plyOf(0), list] }]),
    'doubles.ply': writePly([{ name: 'vertex', columns: doubles }]),
    'a.spz': writeSpz(rawSplats(9, 1), { version: 2 }),
  };
  for (const [name, bytes] of Object.entries(files)) {
    assert.equal(await splatRanges(bytes, name), undefined, name);
    assert.ok((await readScene(bytes, { name })).count > 0, name);
  }
  await assert.rejects(readSplats(files['a.spz'], { first: 0, end: 1 }, 'a.spz'), { code: 'argument/value' });
});

test('the header of a PLY determines the position of its rows', async () => {
  const bytes = writePly([{ name: 'vertex', columns: plyOf(1) }]);
  const { rows, count } = (await splatRanges(bytes, 'a.ply'))!;
  assert.deepEqual(await splatRanges(bytes.subarray(0, rows!.start), 'a.ply'), { count, shDegree: 1, rows });
  assert.equal(rows!.start + count * rows!.byteLength, bytes.length);
});

test('a file that lacks a part is refused as when it is read at once', async () => {
  const ply = writePly([{ name: 'vertex', columns: plyOf(1) }]);
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(9, 1) }]], [{ mesh: 0 }], [0]);
  const accessors = json.accessors as { count: number }[];
  accessors[3].count = 8;
  for (const [name, bytes] of [
    ['a.ply', ply.subarray(0, ply.length - 4)],
    ['a.glb', writeGlb(json, buffer).subarray(0, -8)],
    ['b.glb', writeGlb(json, buffer)],
  ] as const) {
    const whole = await readScene(bytes, { name }).catch((error: Error) => error.message);
    const part = await readSplats(bytes, { first: 0, end: 2 }, name).catch((error: Error) => error.message);
    assert.equal(part, whole);
    assert.match(String(part), /decode\//, name);
  }
});
