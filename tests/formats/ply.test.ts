import assert from 'node:assert/strict';
import { test } from 'node:test';
import fc from 'fast-check';
import { encodingsFor } from '@gaussian-splat/optimize';
import { readScene } from '@gaussian-splat/formats';
import { assertAtMost, expectRefusal, largestDifference } from './support/expect.js';
import { writePly, type PlyColumn, type PlyEncoding, type PlyType } from './support/ply-writer.js';
import { activated, inriaColumns, rawSplats, type RawSplats } from './support/splats.js';
import type { GaussianCloud, ShDegree } from '@gaussian-splat/core';

const ENCODINGS: readonly PlyEncoding[] = ['ascii', 'binary_little_endian', 'binary_big_endian'];

function assertHolds(cloud: GaussianCloud, splats: RawSplats, degree = Math.min(3, splats.degree)): void {
  const expected = activated(splats, degree as ShDegree);
  assert.equal(cloud.count, splats.count);
  assert.equal(cloud.shDegree, degree);
  assert.deepEqual(cloud.origin, [0, 0, 0]);
  assert.equal(largestDifference(cloud.positions, expected.positions), 0, 'positions');
  assert.equal(largestDifference(cloud.sh, expected.sh), 0, 'sh');
  assertAtMost(largestDifference(cloud.scales, expected.scales), 3e-7, 'scales');
  assertAtMost(largestDifference(cloud.opacities, expected.opacities), 1e-7, 'opacities');
  assertAtMost(largestDifference(cloud.rotations, expected.rotations), 2e-7, 'rotations');
}

for (const encoding of ENCODINGS) {
  for (const degree of [0, 1, 2, 3, 4]) {
    test(`${encoding}, degree ${degree}: every value arrives`, async () => {
      const splats = rawSplats(37, degree);
      assertHolds(await readScene(writePly([{ name: 'vertex', columns: inriaColumns(splats) }], { encoding })), splats);
    });
  }
}

test('a header may be long, and end anywhere', async () => {
  const splats = rawSplats(3, 0);
  const file = (length: number): Uint8Array =>
    writePly([{ name: 'vertex', columns: inriaColumns(splats) }], { headerLines: [`comment ${'c'.repeat(length)}`] });
  const rest = Buffer.from(file(0)).indexOf('end_header') + 'end_header\n'.length;
  // From one whose last line ends some bytes before the first 16,384 to one that is longer by as many; and a very long one.
  const lengths = Array.from({ length: 40 }, (_, k) => 16_384 - rest - 20 + k);
  for (const length of [...lengths, 200_000]) assertHolds(await readScene(file(length)), splats);
});

test('any order of properties, extra ones, other elements and types give the same cloud', async () => {
  const wide: readonly PlyType[] = ['float', 'double'];
  await fc.assert(
    fc.asyncProperty(
      fc.record({
        encoding: fc.constantFrom(...ENCODINGS),
        newline: fc.constantFrom('\n' as const, '\r\n' as const, '\r' as const),
        degree: fc.constantFrom(0, 1, 3),
        order: fc.infiniteStream(fc.nat()),
        types: fc.infiniteStream(fc.constantFrom(...wide)),
        listInVertex: fc.boolean(),
        comment: fc.constantFrom('', 'made by hand', 'end_header', 'element vertex 9'),
      }),
      async ({ encoding, newline, degree, order, types, listInVertex, comment }) => {
        const splats = rawSplats(5, degree);
        const extras: PlyColumn[] = [
          { name: 'nx', type: 'short', values: [1, 2, 3, 4, 5] },
          { name: 'label', type: 'uchar', values: [255, 0, 3, 4, 5] },
        ];
        const lists: PlyColumn[] = [
          { name: 'ids', type: 'int', listCountType: 'uchar', values: [[], [1], [2, 3], [], [4]] },
        ];
        const columns = [...inriaColumns(splats), ...extras, ...(listInVertex ? lists : [])].map((column) =>
          column.type === 'float' ? { ...column, type: types.next().value! } : column,
        );
        const shuffled = columns
          .map((column) => ({ column, key: order.next().value! }))
          .sort((a, b) => a.key - b.key)
          .map(({ column }) => column);
        const before: PlyColumn[] = [
          { name: 'corners', type: 'int', listCountType: 'uchar', values: [[1, 2, 3], [], [7]] },
          { name: 'flags', type: 'ushort', values: [1, 2, 3] },
        ];
        const file = writePly(
          [
            { name: 'face', columns: before },
            { name: 'nothing', columns: [], count: 3 },
            { name: 'vertex', columns: shuffled },
            { name: 'camera', columns: [{ name: 'f', type: 'double', values: [1, 2] }] },
          ],
          { encoding, newline, headerLines: [`comment ${comment}`, 'obj_info anything at all'] },
        );
        assertHolds(await readScene(file), splats);
      },
    ),
    { numRuns: 60 },
  );
});

test('bytes at an odd address and bytes after the data change nothing', async () => {
  const splats = rawSplats(9, 1);
  const file = writePly([{ name: 'vertex', columns: inriaColumns(splats) }]);
  for (const shift of [1, 2, 3]) {
    const shifted = new Uint8Array(file.length + shift + 100).subarray(shift);
    shifted.set(file);
    assertHolds(await readScene(shifted), splats);
  }
});

test('float64 coordinates far from the origin keep their detail', async () => {
  const splats = rawSplats(50, 0);
  const far = splats.positions.map(([x, y, z]) => [4_467_123.456 + x / 100, 5_812_345.678 + y / 100, z / 100]);
  const columns = inriaColumns(splats).map((column) => {
    const axis = ['x', 'y', 'z'].indexOf(column.name);
    return axis < 0 ? column : { ...column, type: 'double' as const, values: far.map((p) => p[axis]) };
  });
  for (const encoding of ENCODINGS) {
    const cloud = await readScene(writePly([{ name: 'vertex', columns }], { encoding }));
    const world = Array.from(cloud.positions, (value, i) => value + cloud.origin[i % 3]);
    assertAtMost(largestDifference(world, far.flat()), 1e-8, 'better than float32 alone, which keeps 0.25 here');
  }
});

test('tags of trainers set antialiased', async () => {
  const columns = inriaColumns(rawSplats(1, 0));
  const read = async (line: string) =>
    (await readScene(writePly([{ name: 'vertex', columns }], { headerLines: [line] }))).antialiased;
  assert.equal(await read('comment SplatRenderMode: mip'), true);
  assert.equal(await read('comment antialiased 1'), true);
  assert.equal(await read('comment SplatRenderMode: default'), false);
  assert.equal(await read('comment antialiased 0'), false);
  assert.equal(await read('comment not antialiased 1'), false);
});

test('long comments are searched in linear time', async () => {
  // Expressions match this space of Latin-1, at which words are not separated.
  const tags = ['sort_method', 'antialiased', 'filter_variance'];
  const headerLines = tags.map((tag) => `comment ${tag}${'\u00a0'.repeat(40_000)}1 1`);
  const file = writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(4, 0)) }], { headerLines });
  const start = process.cpuUsage();
  assert.equal((await readScene(file, { name: 'a.ply' })).count, 4);
  const { user } = process.cpuUsage(start);
  assert.ok(user < 1e6, `${user / 1e3} ms`);
});

test('a tag of trainers that order splats pixel by pixel', async () => {
  const columns = inriaColumns(rawSplats(1, 0));
  const read = async (line: string) =>
    (await readScene(writePly([{ name: 'vertex', columns }], { headerLines: [line] }))).hints?.order;
  for (const name of ['pixel', 'per_pixel', 'hierarchical', 'full_sort', 'kbuffer', 'per_pixel_kbuffer'])
    assert.equal(await read(`comment sorting_method ${name}`), 'pixel', name);
  assert.equal(await read('comment SortMode: per_pixel_full'), 'pixel');
  for (const name of ['global', 'cameraDistance', 'z'])
    assert.equal(await read(`comment sorting_method ${name}`), undefined);
  assert.equal(await read('comment no sorting_method pixel'), undefined);
});

test('2D Gaussians without scale_2 are flat discs', async () => {
  const columns = inriaColumns(rawSplats(4, 0)).filter(({ name }) => name !== 'scale_2');
  const cloud = await readScene(writePly([{ name: 'vertex', columns }]));
  assert.equal(cloud.count, 4);
  for (let i = 0; i < 4; i++) {
    assert.ok(cloud.scales[3 * i] > 0, 'some width');
    assert.equal(cloud.scales[3 * i + 2], 0);
  }
  assert.match(cloud.warnings?.join() ?? '', /2DGS/, 'they are drawn otherwise than trained');
});

test('plain colors become the constant coefficient', async () => {
  const splats = rawSplats(2, 0);
  const plain = (type: PlyType, white: number): PlyColumn[] =>
    ['red', 'green', 'blue'].map((name, k) => ({ name, type, values: [white, k === 1 ? white : 0] }));
  for (const [type, white] of [
    ['uchar', 255],
    ['ushort', 65_535],
    ['float', 1],
  ] as const) {
    const columns = inriaColumns(splats).filter(({ name }) => !name.startsWith('f_dc'));
    const { sh } = await readScene(writePly([{ name: 'vertex', columns: [...columns, ...plain(type, white)] }]));
    const colors = Array.from(sh, (value) => 0.5 + 0.28209479177387814 * value);
    assertAtMost(largestDifference(colors, [1, 1, 1, 0, 1, 0]), 1e-6, type);
  }
});

test('splats with unusable values are dropped and counted; extreme logits are not', async () => {
  const splats = rawSplats(6, 0);
  const columns = inriaColumns(splats).map((column) => {
    const values = [...column.values];
    if (column.name === 'y') values[0] = NaN;
    if (column.name.startsWith('rot_')) values[1] = 0;
    if (column.name === 'scale_1') values[2] = 400;
    if (column.name === 'opacity') [values[3], values[4]] = [Infinity, -Infinity];
    return { ...column, values };
  });
  for (const encoding of ENCODINGS) {
    const cloud = await readScene(writePly([{ name: 'vertex', columns }], { encoding }));
    assert.equal(cloud.count, 3, encoding);
    assert.equal(cloud.droppedCount, 3);
    assert.deepEqual([...cloud.opacities.slice(0, 2)], [1, 0]);
  }
});

test('numbers that C libraries print for "not a number" are understood; other words are not', async () => {
  const text = (word: string) => {
    const columns = inriaColumns(rawSplats(2, 0));
    const file = Buffer.from(writePly([{ name: 'vertex', columns }], { encoding: 'ascii' })).toString('latin1');
    const at = file.indexOf('end_header\n') + 'end_header\n'.length;
    return new Uint8Array(Buffer.from(file.slice(0, at) + file.slice(at).replace(/^\S+/, word), 'latin1'));
  };
  for (const word of ['nan', '-nan(ind)', '1.#QNAN', 'inf', '-Infinity', '1.#INF00']) {
    assert.equal((await readScene(text(word))).droppedCount, 1, word);
  }
  for (const word of ['red', '0x10', '1,5', '--1', '1'.repeat(300)]) {
    await expectRefusal(text(word), 'decode/corrupt', /file, byte \d+: expected a number, found/);
  }
});

test('headers that break the specification are refused with their line', async () => {
  const valid = writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(1, 0)) }]);
  const text = Buffer.from(valid).toString('latin1');
  const broken: [from: string, to: string, line: RegExp][] = [
    ['format binary_little_endian 1.0', 'format binary_middle_endian 1.0', /line 2.*binary_middle_endian/],
    ['format binary_little_endian 1.0', 'format binary_little_endian 2.0', /line 2/],
    ['format binary_little_endian 1.0\n', '', /"format"/],
    ['element vertex 1', 'element vertex -1', /line 3.*element NAME COUNT/],
    ['element vertex 1', 'element vertex 99999999999999999999', /line 3/],
    ['element vertex 1', 'element vertex', /line 3/],
    ['property float x', 'property half x', /line 4.*a type out of/],
    ['property float x', 'property list float int x', /line 4.*an integer type/],
    ['property float x', 'property float', /line 4/],
    ['property float y', 'property float x', /line 5.*one property named/],
    ['property float x', 'propperty float x', /line 4/],
    ['element vertex 1\n', '', /line 3.*an element before/],
    ['end_header', 'element vertex 2\nend_header', /one element named/],
  ];
  for (const [from, to, message] of broken) {
    await expectRefusal(new Uint8Array(Buffer.from(text.replace(from, to), 'latin1')), 'decode/header', message);
  }
  const gap = inriaColumns(rawSplats(1, 1)).map((c) => (c.name === 'f_rest_4' ? { ...c, name: 'f_rest_9' } : c));
  await expectRefusal(writePly([{ name: 'vertex', columns: gap }]), 'decode/header', /f_rest.*gaps/);
  const few = inriaColumns(rawSplats(1, 1)).filter(({ name }) => name !== 'f_rest_8');
  await expectRefusal(writePly([{ name: 'vertex', columns: few }]), 'decode/header', /found 8/);
});

test('counts that the file cannot hold are refused before anything is allocated', async () => {
  const columns = inriaColumns(rawSplats(2, 3));
  for (const encoding of ENCODINGS) {
    for (const count of [3, 4_000_000_000, Number.MAX_SAFE_INTEGER]) {
      const file = writePly([{ name: 'vertex', columns, count }], { encoding });
      await expectRefusal(file, 'decode/truncated', /(at most )?2 of |end of the file/);
    }
  }
  const lists: PlyColumn[] = [{ name: 'ids', type: 'int', listCountType: 'uint', values: [[1]] }];
  const file = writePly([
    { name: 'face', columns: lists, count: 4e9 },
    { name: 'vertex', columns },
  ]);
  await expectRefusal(file, 'decode/truncated', /rows of element "face"/);
  const free = writePly([
    { name: 'free', columns: [], count: 4e9 },
    { name: 'vertex', columns },
  ]);
  assert.equal((await readScene(free)).count, 2, 'rows without properties take no time');
});

test('a negative length of a list is refused', async () => {
  const lists: PlyColumn[] = [{ name: 'ids', type: 'int', listCountType: 'char', values: [[1], [2]] }];
  const file = writePly([
    { name: 'face', columns: lists },
    { name: 'vertex', columns: inriaColumns(rawSplats(1, 0)) },
  ]);
  const at = Buffer.from(file).indexOf('end_header\n') + 'end_header\n'.length;
  file[at + 5] = 0xff;
  await expectRefusal(file, 'decode/corrupt', /element "face", property "ids".*found -1/);
});

test('an empty scene is refused', async () => {
  const columns = inriaColumns(rawSplats(0, 0));
  await expectRefusal(writePly([{ name: 'vertex', columns }]), 'decode/empty', /found 0 splats/);
  const dead = inriaColumns(rawSplats(3, 0)).map((c) => (c.name === 'x' ? { ...c, values: [NaN, NaN, NaN] } : c));
  await expectRefusal(
    writePly([{ name: 'vertex', columns: dead }]),
    'decode/empty',
    /3 splats that cannot be drawn: 3 with values that are not finite/,
  );
});

test("Mip-Splatting's filter is part of what is drawn", async () => {
  const raw = rawSplats(5, 0);
  const values = [0, 0.01, 0.2, 1, 5];
  const columns = inriaColumns(raw);
  const plain = await readScene(writePly([{ name: 'vertex', columns }]), { name: 'a.ply' });
  const filtered = [...columns, { name: 'filter_3D', type: 'float' as const, values }];
  const cloud = await readScene(writePly([{ name: 'vertex', columns: filtered }]), { name: 'a.ply' });
  assert.equal(cloud.antialiased, true);
  values.forEach((filter, i) => {
    const before = [...plain.scales.subarray(3 * i, 3 * i + 3)];
    const wide = before.map((s) => Math.sqrt(s * s + filter * filter));
    const share = before.reduce((product, s, k) => (product * s) / wide[k], 1);
    wide.forEach((s, k) => assert.ok(Math.abs(cloud.scales[3 * i + k] - s) < 1e-6 * s));
    assert.ok(Math.abs(cloud.opacities[i] - plain.opacities[i] * share) < 1e-6);
  });
});

test('discs have no third size for a filter to widen', async () => {
  const columns = inriaColumns(rawSplats(5, 0)).filter(({ name }) => name !== 'scale_2');
  const filter = { name: 'filter_3D', type: 'float' as const, values: [1, 1, 1, 1, 1] };
  const plain = await readScene(writePly([{ name: 'vertex', columns }]), { name: 'a.ply' });
  assert.deepEqual(
    await readScene(writePly([{ name: 'vertex', columns: [...columns, filter] }]), { name: 'a.ply' }),
    plain,
  );
});

test('fields that CloudCompare has renamed are those they were', async () => {
  const columns = inriaColumns(rawSplats(5, 1));
  const plain = await readScene(writePly([{ name: 'vertex', columns }]), { name: 'a.ply' });
  const renamed = columns.map((column) =>
    'xyz'.includes(column.name) ? column : { ...column, name: `scalar_${column.name}` },
  );
  assert.deepEqual(await readScene(writePly([{ name: 'vertex', columns: renamed }]), { name: 'a.ply' }), plain);
});

test('a scene far from (0, 0, 0) is written as exactly as it was read', async () => {
  const raw = rawSplats(60, 1);
  const world = [448_123, 5_411_887, 312];
  const columns = inriaColumns(raw).map((column) => {
    const axis = 'xyz'.indexOf(column.name);
    if (axis < 0) return column;
    return {
      ...column,
      type: 'double' as const,
      values: column.values.map((value) => (value as number) + world[axis]),
    };
  });
  const cloud = await readScene(writePly([{ name: 'vertex', columns }]), { name: 'far.ply' });
  assert.ok(cloud.origin.every((x, axis) => Math.abs(x - world[axis]) < 10));
  for (const name of ['a.ply', 'a.glb']) {
    const [encoding] = encodingsFor(name, cloud);
    const file = await encoding.write({ cloud, degrees: new Uint8Array(60).fill(1) });
    const again = await readScene(file, { name });
    for (let k = 0; k < 180; k++) {
      const axis = k % 3;
      const error = again.positions[k] + again.origin[axis] - (cloud.positions[k] + cloud.origin[axis]);
      assert.ok(Math.abs(error) < 1e-5, `${name}: off by ${error}`);
    }
  }
});
