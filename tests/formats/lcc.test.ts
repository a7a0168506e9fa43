/** LCC and LCC2, the formats of XGRIDS: `npm run lab -- tools` holds them against the decoder of splat-transform. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { zipSync } from 'fflate';
import { detectFormat, readScene } from '@gaussian-splat/formats';
import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { assertSameCloud } from './support/expect.js';
import { writeLcc } from './support/lcc-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { writeSog } from './support/sog-writer.js';

type Files = Record<string, Uint8Array>;
type Options = Parameters<typeof readScene>[1];

const read = (files: Files, options: Options = {}): Promise<GaussianCloud> =>
  readScene(files['meta.lcc'], {
    name: 'meta.lcc',
    openFile: (path) => (path in files ? Promise.resolve(files[path]) : Promise.reject(new Error(`no ${path}`))),
    ...options,
  });

function assertNear(found: ArrayLike<number>, expected: ArrayLike<number>, tolerance: number, what: string): void {
  assert.equal(found.length, expected.length, what);
  for (let k = 0; k < found.length; k++)
    assert.ok(Math.abs(found[k] - expected[k]) <= tolerance, `${what} ${k}: ${found[k]} for ${expected[k]}`);
}

/** Either sign of a quaternion is right. */
const signed = ({ rotations }: GaussianCloud): Float32Array =>
  rotations.map((value, k) => value * Math.sign(rotations[4 * Math.floor(k / 4)]));

function assertWithinSteps(found: GaussianCloud, expected: GaussianCloud, what: string): void {
  assert.deepEqual([...found.positions], [...expected.positions], what);
  assertNear(found.opacities, expected.opacities, 0.5 / 255 + 1e-6, `${what}, opacity`);
  assertNear(found.scales, expected.scales, 0.3 / 65_535, `${what}, scale`);
  assertNear(signed(found), signed(expected), 4e-3, `${what}, rotation`);
  const width = found.sh.length / found.count;
  const isConstant = (_: number, k: number): boolean => k % width < 3;
  assertNear(found.sh.filter(isConstant), expected.sh.filter(isConstant), 0.5 / 255 / 0.282 + 1e-5, `${what}, color`);
  assertNear(found.sh, expected.sh, 0.5 / 255 / 0.282 + 1e-5, `${what}, harmonics`);
}

test('written scenes are read, with any cells, with z up', async () => {
  for (const shDegree of [3, 0] as const) {
    const cloud = smallCloud(50, shDegree);
    for (const cellSize of [Infinity, 50, 16, 1]) {
      const files = writeLcc([cloud], { cellSize });
      assert.equal(detectFormat(files['meta.lcc']), 'lcc');
      const found = await read(files);
      assert.equal(found.shDegree, shDegree);
      assertWithinSteps(found, cloud, `degree ${shDegree}, cells of ${cellSize}`);
      assert.deepEqual([found.hints?.up, found.warnings], [[0, 0, 1], undefined]);
    }
  }
});

test('a level is read, the finest by default, and the finest that a page allows', async () => {
  const levels = [40, 20, 5].map((count) => smallCloud(count, 3, count));
  const files = writeLcc(levels, { cellSize: 8 });
  assertWithinSteps(await read(files), levels[0], 'the finest');
  for (const [level, count] of [
    [1, 20],
    [2, 5],
    [9, 5],
  ])
    assert.equal((await read(files, { level })).count, count);
  assert.equal((await read(files, { maxSplats: 30 })).count, 20);
});

test('the splats around the scene are drawn beside it, with ranges of their own', async () => {
  for (const shDegree of [3, 0] as const) {
    const [scene, environment] = [smallCloud(30, shDegree), smallCloud(10, shDegree, 2)];
    for (let k = 0; k < environment.scales.length; k++) environment.scales[k] *= 100;
    const found = await read(writeLcc([scene], { environment }));
    assert.equal(found.count, 40);
    assertNear(found.scales.subarray(90), environment.scales, 30 / 65_535, 'scale');
    assert.deepEqual([...found.positions.subarray(90)], [...environment.positions]);
  }
});

test('surroundings that a lost connection keeps away are named; a server that has none says nothing', async () => {
  const files = writeLcc([smallCloud(20, 0)]);
  const refused = (code: 'network/unreachable' | 'network/status'): Promise<GaussianCloud> =>
    read(files, {
      openFile: (path) =>
        path in files
          ? Promise.resolve(files[path])
          : Promise.reject(
              new GaussianSplatError(code, { where: path, expected: 'it', found: 'not', remedy: 'retry' }),
            ),
    });
  assert.equal((await refused('network/status')).warnings, undefined);
  assert.match(
    (await refused('network/unreachable')).warnings!.join(),
    /surroundings \(environment\.bin\) are left out/,
  );
});

test('descriptions without a file type have harmonics if they have their range', async () => {
  const files = writeLcc([smallCloud(20, 3)], { meta: { fileType: undefined } });
  assert.equal((await read(files)).shDegree, 3);
});

test('an archive of the folder is that scene', async () => {
  const files = writeLcc([smallCloud(30, 3)], { environment: smallCloud(5, 3, 4) });
  const zip = zipSync(Object.fromEntries(Object.entries(files).map(([path, bytes]) => [`a/${path}`, bytes])));
  assertSameCloud(await readScene(zip, { name: 'a.zip' }), await read(files));
});

test('damaged files are refused by name', async () => {
  const files = writeLcc([smallCloud(30, 3), smallCloud(10, 3)], { cellSize: 10 });
  const withBytes = (path: string, change: (view: DataView) => void): Files => {
    const bytes = files[path].slice();
    change(new DataView(bytes.buffer));
    return { ...files, [path]: bytes };
  };
  const withMeta = (meta: object): Files => writeLcc([smallCloud(30, 3)], { meta: meta as Record<string, unknown> });
  const cases: readonly (readonly [Files, RegExp])[] = [
    [withMeta({ totalLevel: 0 }), /^decode\/header.*totalLevel/],
    [withMeta({ totalLevel: 1e9 }), /^decode\/header.*totalLevel/],
    [withMeta({ encoding: 'RAW' }), /^decode\/unsupported.*encoding/],
    [withMeta({ attributes: [] }), /^decode\/header.*attributes, scale/],
    [{ ...files, 'index.bin': files['index.bin'].subarray(1) }, /^decode\/truncated.*index\.bin/],
    [{ ...files, 'data.bin': files['data.bin'].subarray(64) }, /^decode\/truncated.*data\.bin/],
    [{ ...files, 'shcoef.bin': files['shcoef.bin'].subarray(64) }, /^decode\/truncated.*shcoef\.bin/],
    [withBytes('index.bin', (view) => view.setUint32(4, 0xffffffff, true)), /^decode\/corrupt.*index\.bin/],
    [withBytes('index.bin', (view) => view.setBigUint64(8, 2n ** 63n, true)), /^decode\/corrupt.*index\.bin/],
    [withBytes('index.bin', (view) => view.setBigUint64(8, 33n, true)), /^decode\/corrupt.*multiples of 32/],
    [{ ...files, 'environment.bin': new Uint8Array(95) }, /^decode\/truncated.*environment\.bin/],
    [Object.fromEntries(Object.entries(files).filter(([path]) => path !== 'data.bin')), /no data\.bin/],
  ];
  for (const [changed, expected] of cases) {
    const said = await read(changed).then(
      () => 'read',
      (error: Error & { code?: string }) => `${error.code ?? ''} ${error.message}`.trim(),
    );
    assert.match(said, expected);
  }
});

const json = (value: unknown): Uint8Array => new TextEncoder().encode(JSON.stringify(value));
const bundle = (count: number, seed: number): Uint8Array => zipSync(writeSog(smallCloud(count, 1, seed)));

/** Two nodes, each with a coarse bundle and finer ones below, and a bundle around them. */
const BUNDLES: Files = {
  ...{ 'd/0.sog': bundle(10, 1), 'd/1.sog': bundle(11, 2), 'd/2.sog': bundle(40, 3), 'd/3.sog': bundle(41, 4) },
  'd/e.sog': bundle(5, 5),
};
const node = (name: number, child?: object): object => ({ data: { '3dgs': { name } }, ...(child && { child }) });
const LCC2: Readonly<Record<string, object>> = {
  'with lists': {
    ...{ totalLevels: 2, totalSplats: 102, lodSplats: [81, 21] },
    root: {
      splatFiles: Object.keys(BUNDLES),
      data: { env: { name: 4 } },
      child: [node(0, [node(2), { child: [] }]), node(1, [node(3), node(3)])],
    },
  },
  'of the earlier form': {
    ...{ lod_level: 2, total_splats: 102, lod_3dgs_info: [21, 81] },
    root: {
      files: Object.keys(BUNDLES).map((path) => `/${path.replace('.sog', '')}`),
      data: { env: { name: 4 } },
      child: { a: node(0, { a: node(2) }), b: node(1, { a: node(3) }) },
    },
  },
};

test('LCC2 is read from its bundles at a level, with what is around it, and z up', async () => {
  const alone = (path: string): Promise<GaussianCloud> => readScene(BUNDLES[path], { name: path });
  const expected = await Promise.all(['d/2.sog', 'd/3.sog', 'd/e.sog'].map(alone));
  for (const [name, description] of Object.entries(LCC2)) {
    const files = { 'meta.lcc': json(description), ...BUNDLES };
    assert.equal(detectFormat(files['meta.lcc']), 'lcc2', name);
    const found = await read(files);
    assert.deepEqual(
      [...found.positions],
      expected.flatMap(({ positions }) => [...positions]),
      name,
    );
    assert.deepEqual(
      [...found.sh],
      expected.flatMap(({ sh }) => [...sh]),
      name,
    );
    assert.deepEqual(found.hints?.up, [0, 0, 1]);
    assert.equal((await read(files, { level: 1 })).count, 26, name);
    assert.equal((await read(files, { maxSplats: 50 })).count, 26, name);
    // A bundle beside the description is a part of the scene, too.
    const flat = Object.entries(files).map(([path, bytes]) => [`a/${path.replace('meta.lcc', 'meta.lcc2')}`, bytes]);
    const zip = zipSync({ ...Object.fromEntries(flat), 'a/beside.sog': BUNDLES['d/0.sog'] });
    assertSameCloud(await readScene(zip, { name: 'a.zip' }), found);
  }
});

test('LCC2 is read without the bundle of its surroundings, and with commas before closing brackets', async () => {
  const description = JSON.stringify(LCC2['with lists']).replace(/[\]}]/g, ',$&');
  const { 'd/e.sog': around, ...bundles } = BUNDLES;
  assert.ok(around);
  const found = await read({ 'meta.lcc': new TextEncoder().encode(description), ...bundles });
  assert.equal(found.count, 81);
  assert.match(found.warnings!.join(), /surroundings \(d\/e\.sog\) are left out/);
});

test('LCC2 that is damaged, or has parts of another kind, is refused by name', async () => {
  const base = LCC2['with lists'] as { root: object };
  const cases: readonly (readonly [object, RegExp])[] = [
    [{ ...base, splatType: '.spz' }, /^decode\/unsupported.*splatType/],
    [{ ...base, totalLevels: 1e9 }, /^decode\/header.*totalLevels/],
    [{ ...base, root: {} }, /^decode\/header.*root\.splatFiles/],
    [{ ...base, root: { ...base.root, child: [node(9)] } }, /^decode\/header.*data\.3dgs\.name.*below 5/],
    [{ ...base, root: { ...base.root, child: [] } }, /^decode\/header.*root\.child/],
    [{ ...base, root: { ...base.root, splatFiles: ['a'.repeat(3000)] } }, /^decode\/header.*root\.splatFiles/],
  ];
  for (const [description, expected] of cases) {
    const said = await read({ 'meta.lcc': json(description), ...BUNDLES }).then(
      () => 'read',
      (error: Error & { code?: string }) => `${error.code} ${error.message}`,
    );
    assert.match(said, expected);
  }
});
