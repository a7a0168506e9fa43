/** 3D Tiles whose tiles hold splats: tilesets are made here after the standard, OGC 22-025. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { readScene } from '@gaussian-splat/formats';
import type { GaussianCloud } from '@gaussian-splat/core';
import { expectRefusal } from './support/expect.js';
import { buildGltf, writeGlb } from './support/gltf-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { isLab } from '../support/extent.js';

type Files = Record<string, Uint8Array>;

const json = (value: unknown): Uint8Array => new TextEncoder().encode(JSON.stringify(value));
const glb = (count: number, seed: number): Uint8Array => {
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(count, 1, seed) }]], [{ mesh: 0 }], [0]);
  return writeGlb(json, buffer);
};
const tileset = (root: object): Uint8Array => json({ asset: { version: '1.1' }, geometricError: 100, root });
const tile = (uri: string | undefined, more: object = {}): object => ({
  boundingVolume: { sphere: [0, 0, 0, 10] },
  geometricError: 1,
  ...(uri === undefined ? {} : { content: { uri } }),
  ...more,
});

const readTiles = async (files: Files, level?: number, maxSplats?: number): Promise<GaussianCloud> =>
  readScene(files['tileset.json'], {
    ...{ name: 'tileset.json', level, maxSplats },
    openFile: (path) => (path in files ? Promise.resolve(files[path]) : Promise.reject(new Error(`no ${path}`))),
  });
const whole = (bytes: Uint8Array): Promise<GaussianCloud> => readScene(bytes, { name: 'a.glb' });
const worldOf = ({ positions, origin }: GaussianCloud): number[] => [...positions].map((x, k) => x + origin[k % 3]);

function assertNear(found: ArrayLike<number>, expected: ArrayLike<number>, tolerance: number): void {
  assert.equal(found.length, expected.length);
  for (let k = 0; k < found.length; k++)
    assert.ok(Math.abs(found[k] - expected[k]) <= tolerance, `${k}: ${found[k]} for ${expected[k]}`);
}

/** A coarse tile that two finer ones replace; one of those is in a tileset of its own. */
const TREE: Files = {
  'tileset.json': tileset(
    tile('root.glb', { refine: 'REPLACE', children: [tile('fine/a.glb?key=1'), tile('inner/tileset.json')] }),
  ),
  'inner/tileset.json': tileset(tile('b.glb')),
  ...{ 'root.glb': glb(10, 1), 'fine/a.glb': glb(20, 2), 'inner/b.glb': glb(30, 3) },
};

test('the finest tiles are the scene, and each level leaves out the lowest', async () => {
  const [a, b, root] = await Promise.all(['fine/a.glb', 'inner/b.glb', 'root.glb'].map((path) => whole(TREE[path])));
  const finest = await readTiles(TREE);
  assert.equal(finest.count, 50);
  assertNear(finest.positions, [...a.positions, ...b.positions], 1e-6);
  assertNear(finest.sh, [...a.sh, ...b.sh], 1e-6);
  const coarse = await readTiles(TREE, 1);
  assertNear(coarse.positions, root.positions, 1e-6);
});

test('the finest level with few enough splats is read; if the coarsest has too many, the error says so', async () => {
  const counts = [50, 49, 10].map(async (max) => (await readTiles(TREE, undefined, max)).count);
  assert.deepEqual(await Promise.all(counts), [50, 10, 10]);
  await assert.rejects(readTiles(TREE, undefined, 9), {
    code: 'out-of-memory/budget',
    message: /at most 9 splats.*10/s,
  });
});

test('tiles that are added are drawn beside those below them', async () => {
  const root = tile('root.glb', { refine: 'ADD', children: [tile('fine/a.glb')] });
  assert.equal((await readTiles({ ...TREE, 'tileset.json': tileset(root) })).count, 30);
});

/** Counts the files that are opened; each has the bytes of `answer`. */
async function opened(root: object, answer: (path: string) => Uint8Array): Promise<{ code: string; paths: string[] }> {
  const paths: string[] = [];
  const openFile = (path: string): Promise<Uint8Array> => Promise.resolve(answer(paths[paths.push(path) - 1]));
  const code = await readScene(tileset(root), { name: 'tileset.json', openFile }).then(
    ({ count }) => `${count} splats`,
    (error: { code?: string }) => error.code ?? `unnamed: ${String(error)}`,
  );
  return { code, paths };
}

test('a chain of added tiles is drawn from the top to the bottom, each tile once', async () => {
  const chain = Array.from({ length: 400 }).reduce<object>(
    (below, _, k) => tile(`${399 - k}.glb`, { refine: 'ADD', children: [below] }),
    tile('last.glb'),
  );
  const { code, paths } = await opened(chain, () => TREE['root.glb']);
  assert.equal(code, `${401 * 10} splats`);
  assert.deepEqual(
    paths,
    [...Array(400).keys(), 'last'].map((name) => `${name}.glb`),
  );
});

test('the bytes that arrive bound the requests', async () => {
  const many = tile(undefined, { children: Array.from({ length: 4000 }, (_, k) => tile(`${k}.glb`)) });
  const small = await opened(many, () => new TextEncoder().encode('b3dm'));
  assert.equal(small.code, 'out-of-memory/budget');
  const bytes = tileset(many).length + 4 * small.paths.length;
  assert.ok(small.paths.length <= 1000 + bytes / 1024, `${small.paths.length} requests`);
});

test('transforms of tiles are those of a frame whose third axis points up', async () => {
  // A quarter turn about the vertical, then 5 to the east, 7 to the north and 2 up.
  const transform = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 7, 2, 1];
  const files = { ...TREE, 'tileset.json': tileset(tile('root.glb', { transform })) };
  const [plain, found] = [await whole(TREE['root.glb']), await readTiles(files)];
  const expected = Array.from({ length: plain.count }, (_, i) => {
    // East, north, up: glTF has x to the east and -z to the north; a cloud -x and -z, and y down.
    const [east, north, up] = [-plain.positions[3 * i], -plain.positions[3 * i + 2], -plain.positions[3 * i + 1]];
    const [e, n, u] = [5 - north, 7 + east, 2 + up];
    return [-e, -u, -n];
  });
  assertNear(worldOf(found), expected.flat(), 1e-5);
  assert.equal(found.hints?.up, undefined);
});

test('the vertical axis of glTF contents of early tilesets applies to them and to their harmonics', async () => {
  const plain = await whole(TREE['root.glb']);
  // East, north and up of a point of a glTF, as CesiumJS turns its axes.
  const turns: Readonly<Record<string, (x: number, y: number, z: number) => number[]>> = {
    Y: (x, y, z) => [x, -z, y],
    Z: (x, y, z) => [x, y, z],
    x: (x, y, z) => [-z, y, x],
  };
  const read = (gltfUpAxis: unknown, root: object = tile('root.glb')): Promise<GaussianCloud> =>
    readTiles({ ...TREE, 'tileset.json': json({ asset: { version: '1.0', gltfUpAxis }, geometricError: 9, root }) });
  const sh = new Set<string>();
  for (const [axis, turn] of Object.entries(turns)) {
    const found = await read(axis);
    const expected = Array.from({ length: plain.count }, (_, i) => {
      const [x, y, z] = plain.positions.subarray(3 * i, 3 * i + 3);
      const [e, n, u] = turn(-x, -y, z);
      return [-e, -u, -n];
    });
    assertNear(worldOf(found), expected.flat(), 1e-5);
    sh.add([...found.sh.subarray(3, 12)].map((value) => value.toFixed(4)).join());
  }
  assert.equal(sh.size, 3, 'the harmonics turn along');
  // A tileset within has its own axis.
  const inner = await read('Z', tile('inner/tileset.json'));
  assertNear(inner.positions, (await whole(TREE['inner/b.glb'])).positions, 1e-6);
  const odd = json({ asset: { version: '1.0', gltfUpAxis: 'W' }, geometricError: 9, root: tile('root.glb') });
  await expectRefusal(odd, 'decode/unsupported', /gltfUpAxis: expected X, Y or Z, found "W"/, { name: 'tileset.json' });
});

test('a tileset on the Earth keeps its digits and knows where up is', async () => {
  const [lon, lat] = [0.2, 0.8];
  const up = [Math.cos(lat) * Math.cos(lon), Math.cos(lat) * Math.sin(lon), Math.sin(lat)];
  const east = [-Math.sin(lon), Math.cos(lon), 0];
  const north = [
    up[1] * east[2] - up[2] * east[1],
    up[2] * east[0] - up[0] * east[2],
    up[0] * east[1] - up[1] * east[0],
  ];
  const at = up.map((x) => 6.37e6 * x);
  const transform = [...east, 0, ...north, 0, ...up, 0, ...at, 1];
  const files = { ...TREE, 'tileset.json': tileset(tile('root.glb', { transform })) };
  const [plain, found] = [await whole(TREE['root.glb']), await readTiles(files)];
  const heights = Array.from({ length: found.count }, (_, i) =>
    [0, 1, 2].reduce((sum, k) => sum + found.hints!.up![k] * (found.positions[3 * i + k] + found.origin[k]), -6.37e6),
  );
  assertNear(
    heights,
    Array.from({ length: plain.count }, (_, i) => -plain.positions[3 * i + 1]),
    1e-4,
  );
});

interface SubtreeBits {
  /** Indices of the tiles, by level and Morton index. */
  readonly tiles: readonly number[];
  /** For each content, the tiles that have it; 1 for all. */
  readonly contents: readonly (readonly number[] | 1)[];
  /** Morton indices of the subtrees below. */
  readonly children?: readonly number[];
}

/** A subtree after section 8 of the standard: binary, or JSON with a buffer beside it. */
function subtree({ tiles, contents, children = [] }: SubtreeBits, beside?: string): Files {
  const views: Uint8Array[] = [];
  const bitsOf = (indices: readonly number[] | 1): object => {
    if (indices === 1) return { constant: 1 };
    const bits = new Uint8Array(8);
    for (const index of indices) bits[index >> 3] |= 1 << (index & 7);
    return indices.length === 0 ? { constant: 0 } : { bitstream: views.push(bits) - 1 };
  };
  const availability = {
    tileAvailability: bitsOf(tiles),
    contentAvailability: contents.map(bitsOf),
    childSubtreeAvailability: bitsOf(children),
  };
  const binary = new Uint8Array(Buffer.concat(views));
  const description = json({
    buffers: [{ byteLength: binary.length, ...(beside && { uri: beside }) }],
    bufferViews: views.map((_, k) => ({ buffer: 0, byteOffset: 8 * k, byteLength: 8 })),
    ...availability,
  });
  if (beside) return { subtree: description, [beside]: binary };
  const head = new DataView(new ArrayBuffer(24));
  [...'subt'].forEach((letter, k) => head.setUint8(k, letter.charCodeAt(0)));
  head.setUint32(4, 1, true);
  const text = new Uint8Array(8 * Math.ceil(description.length / 8)).fill(32);
  text.set(description);
  head.setBigUint64(8, BigInt(text.length), true);
  head.setBigUint64(16, BigInt(binary.length), true);
  return { subtree: new Uint8Array(Buffer.concat([new Uint8Array(head.buffer), text, binary])) };
}

/** A quadtree: its root, two tiles below it, and one below the second of these, in a subtree of its own. */
function quadtree(beside: string | undefined, more: object = {}): Files {
  const upper = subtree({ tiles: [0, 1, 4], contents: [[0, 1]], children: [14] }, beside);
  const lower = subtree({ tiles: [0], contents: [1] });
  const implicitTiling = {
    ...{ subdivisionScheme: 'QUADTREE', subtreeLevels: 2, availableLevels: 3 },
    subtrees: { uri: 's/{level}/{x}/{y}.subtree' },
  };
  return {
    'tileset.json': tileset(tile('c/{level}/{x}/{y}.glb', { implicitTiling, ...more })),
    's/0/0/0.subtree': upper.subtree,
    ...(beside && { [`s/0/0/${beside}`]: upper[beside] }),
    's/2/2/3.subtree': lower.subtree,
    ...{ 'c/0/0/0.glb': glb(10, 1), 'c/1/0/0.glb': glb(20, 2), 'c/2/2/3.glb': glb(30, 3) },
  };
}

test('implicit tiles are found by the bits of their subtrees', async () => {
  for (const beside of [undefined, 'bits.bin']) {
    const files = quadtree(beside);
    const [a, b] = await Promise.all(['c/1/0/0.glb', 'c/2/2/3.glb'].map((path) => whole(files[path])));
    assertNear((await readTiles(files)).positions, [...a.positions, ...b.positions], 1e-6);
    assert.equal((await readTiles(files, 2)).count, 10);
    assert.equal((await readTiles(quadtree(beside, { refine: 'ADD' }))).count, 60);
  }
});

test('the buffer of a subtree is opened once, however many views it has', async () => {
  const files = quadtree('bits.bin');
  const paths: string[] = [];
  const openFile = (path: string): Promise<Uint8Array> => Promise.resolve(files[paths[paths.push(path) - 1]]);
  await readScene(files['tileset.json'], { name: 'tileset.json', openFile });
  assert.deepEqual(
    paths.filter((path) => path.endsWith('.bin')),
    ['s/0/0/bits.bin'],
  );
});

test('implicit tiles may be an octree, have several contents, be those of version 1.0, and be within another tileset', async () => {
  const tiling = { subdivisionScheme: 'OCTREE', subtreeLevels: 2, subtrees: { uri: '{level}/{x}/{y}/{z}.json' } };
  const bits = subtree({ tiles: [0, 8], contents: [1, [8]] });
  const contents = [{ uri: '{level}-{x}-{y}-{z}.glb' }, { uri: 'b.glb' }];
  const files = { 'in/0/0/0/0.json': bits.subtree, ...{ 'in/1-1-1-1.glb': glb(10, 1), 'in/b.glb': glb(20, 2) } };
  for (const inner of [
    tile(undefined, { implicitTiling: { ...tiling, availableLevels: 2 }, contents }),
    tile(undefined, {
      extensions: {
        '3DTILES_implicit_tiling': { ...tiling, maximumLevel: 1 },
        '3DTILES_multiple_contents': { content: contents },
      },
    }),
  ]) {
    const found = await readTiles({
      ...files,
      'tileset.json': tileset(tile('in/a.json')),
      'in/a.json': tileset(inner),
    });
    assert.equal(found.count, 30);
  }
});

test('subtrees that are damaged, or have no end, are refused by name', async () => {
  const files = quadtree(undefined);
  const said = async (changes: Files): Promise<string> =>
    readTiles({ ...files, ...changes }).then(
      () => 'read',
      (error: Error & { code?: string }) => `${error.code} ${error.message}`,
    );
  const upper = files['s/0/0/0.subtree'];
  assert.match(
    await said({ 's/0/0/0.subtree': upper.subarray(0, upper.length - 1) }),
    /^decode\/truncated.*0\.subtree/,
  );
  assert.match(await said({ 's/0/0/0.subtree': json({ tileAvailability: { bitstream: 9 } }) }), /^decode\/header/);
  const beyond = { buffers: [{}], bufferViews: [{ buffer: 0, byteLength: 99 }], tileAvailability: { bitstream: 0 } };
  assert.match(await said({ 's/0/0/0.subtree': json(beyond) }), /^decode\/corrupt.*tileAvailability/);
  const all = { constant: 1 };
  const endless = (childSubtreeAvailability: object): Uint8Array =>
    json({ tileAvailability: all, contentAvailability: [all], childSubtreeAvailability });
  const read = (levels: number, answer: Uint8Array, code: string, message: RegExp): Promise<unknown> => {
    const implicitTiling = {
      ...{ subdivisionScheme: 'OCTREE', subtreeLevels: levels, availableLevels: 50 },
      subtrees: { uri: '{level}{x}{y}{z}' },
    };
    const root = tileset(tile('a{x}.glb', { implicitTiling }));
    return expectRefusal(root, code, message, { name: 'tileset.json', openFile: () => Promise.resolve(answer) });
  };
  if (isLab) await read(16, endless({ constant: 0 }), 'decode/header', /at most 100,000 tiles/);
  await read(1, endless(all), 'out-of-memory/budget', /at most 1,\d+ requests/);
});

test('tiles without splats are left out with a warning, and a tileset of them is refused', async () => {
  const mesh = json({ asset: { version: '2.0' } });
  const children = [tile('fine/a.glb'), tile('mesh.gltf')];
  const files = { ...TREE, 'mesh.gltf': mesh, 'tileset.json': tileset(tile(undefined, { children })) };
  assert.match((await readTiles(files)).warnings!.join(), /1 tiles? without splats/);
  const none = tileset(tile('mesh.gltf'));
  const openFile = (): Promise<Uint8Array> => Promise.resolve(mesh);
  await expectRefusal(none, 'decode/unsupported', /KHR_gaussian_splatting.*1 tiles without/, {
    name: 'a.json',
    openFile,
  });
});

test('tiles of 3D Tiles 1.0 are left out as others without splats are', async () => {
  for (const magic of ['b3dm', 'i3dm', 'pnts', 'cmpt']) {
    const old = new Uint8Array(Buffer.concat([Buffer.from(magic), Buffer.alloc(24)]));
    const children = [tile('fine/a.glb'), tile('old')];
    const files = { ...TREE, old, 'tileset.json': tileset(tile(undefined, { children })) };
    const found = await readTiles(files);
    assert.equal(found.count, 20);
    assert.match(found.warnings!.join(), /1 tiles without splats/);
  }
});

test('files beside a tile are found in a folder whose name is encoded in its address', async () => {
  const { json: gltf, buffer } = buildGltf([[{ cloud: smallCloud(8, 1) }]], [{ mesh: 0 }], [0]);
  const files = {
    'tileset.json': tileset(tile('a%20b/inner.json?key=1')),
    'a b/inner.json': tileset(tile('c%C3%A4/tile.gltf')),
    'a b/c\u00e4/tile.gltf': json({ ...gltf, buffers: [{ uri: 'own%20data.bin', byteLength: buffer.length }] }),
    'a b/c\u00e4/own data.bin': buffer,
  };
  assert.equal((await readTiles(files)).count, 8);
});

test('what is wrong with a tileset is said', async () => {
  const refused = (root: object, code: string, message: RegExp): Promise<unknown> =>
    expectRefusal(tileset(root), code, message, { name: 'tileset.json', openFile: () => Promise.resolve(glb(3, 1)) });
  const tiling = { subdivisionScheme: 'QUADTREE', subtreeLevels: 2, availableLevels: 3 };
  const uri = '{level}/{x}/{y}.subtree';
  for (const [changes, message] of [
    [{ subdivisionScheme: 'BSP' }, /subdivisionScheme/],
    [{ subtreeLevels: 0 }, /subtreeLevels/],
    [{ subtreeLevels: 26 }, /subtreeLevels.*1 to 25/],
    [{ availableLevels: undefined }, /availableLevels/],
    [{ subtrees: { uri: 'same.subtree' } }, /subtrees\.uri.*\{level\}, \{x\} and \{y\}/],
    [{ subtrees: { uri: uri.repeat(200) } }, /at most 2,048 characters/],
  ] as const)
    await refused(
      tile('a.glb', { implicitTiling: { ...tiling, subtrees: { uri }, ...changes } }),
      'decode/header',
      message,
    );
  await refused(tile('a.glb', { transform: [1, 2] }), 'decode/header', /root.transform.*16 numbers/);
  await refused(tile(undefined, { children: [3] }), 'decode/header', /root.children\[0\].*a tile/);
  await refused(tile(`${'./'.repeat(2_000)}a.glb`), 'decode/header', /addresses of at most 2,048 characters/);
  const itself = tileset(tile('again.json'));
  await expectRefusal(itself, 'decode/header', /at most 16 deep/, {
    name: 'tileset.json',
    openFile: () => Promise.resolve(itself),
  });
});
