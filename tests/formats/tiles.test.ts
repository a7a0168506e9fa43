/** 3D Tiles whose tiles hold splats: tilesets are made here after the standard, OGC 22-025. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { readScene } from '@gaussian-splat/formats';
import type { GaussianCloud } from '@gaussian-splat/core';
import { expectRefusal } from './support/expect.js';
import { buildGltf, writeGlb } from './support/gltf-writer.js';
import { smallCloud } from './support/small-cloud.js';

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

const readTiles = async (files: Files, level?: number): Promise<GaussianCloud> =>
  readScene(files['tileset.json'], {
    ...{ name: 'tileset.json', level },
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

test('tiles that are added are drawn beside those below them', async () => {
  const root = tile('root.glb', { refine: 'ADD', children: [tile('fine/a.glb')] });
  assert.equal((await readTiles({ ...TREE, 'tileset.json': tileset(root) })).count, 30);
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
  await refused(tile('a.glb', { implicitTiling: {} }), 'decode/unsupported', /root.*implicit tiling/);
  await refused(tile('a.glb', { transform: [1, 2] }), 'decode/header', /root.transform.*16 numbers/);
  await refused(tile(undefined, { children: [3] }), 'decode/header', /root.children\[0\].*a tile/);
  await refused(tile(`${'./'.repeat(2_000)}a.glb`), 'decode/header', /addresses of at most 2,048 characters/);
  const itself = tileset(tile('again.json'));
  await expectRefusal(itself, 'decode/header', /at most 16 deep/, {
    name: 'tileset.json',
    openFile: () => Promise.resolve(itself),
  });
});
