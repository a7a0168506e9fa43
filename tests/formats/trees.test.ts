/** Scenes whose files are trees of levels, node by node: the nodes of 3D Tiles, LCC, LCC2 and RAD, their volumes, and what is read for each. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import {
  LoadBudget,
  openTree as openAny,
  readNode,
  readScene,
  sogAddress,
  SogFiles,
  type SceneNode,
  type SceneTree,
  type TreeFiles,
} from '@gaussian-splat/formats';
import { writeRadTree } from '../support/rad-tree.js';
import { splatTileset } from '../support/tileset.js';
import { writeLcc } from './support/lcc-writer.js';
import { writeLcc2 } from './support/lcc2-writer.js';
import { smallCloud } from './support/small-cloud.js';

type Files = ReadonlyMap<string, Uint8Array>;

/** Access to files in memory, and the list of what was opened. */
function beside(files: Files): TreeFiles & { readonly opened: string[] } {
  const opened: string[] = [];
  const openFile = async (path: string): Promise<Uint8Array> => {
    const plain = path
      .split('/')
      .reduce<string[]>((all, part) => (part === '..' ? all.slice(0, -1) : [...all, part]), []);
    opened.push(plain.join('/'));
    const found = files.get(plain.join('/'));
    if (!found) throw new Error(`no ${path}`);
    return found;
  };
  const openRange = async (path: string, start: number, end: number): Promise<Uint8Array> =>
    (await openFile(path)).subarray(start, end);
  const kept = new Map<string, Promise<Uint8Array>>();
  const openIndex = (path: string): Promise<Uint8Array> => {
    const opening = kept.get(path) ?? openFile(path);
    kept.set(path, opening);
    return opening;
  };
  const openShared = async (path = [...files.keys()][0], start: number, end: number): Promise<Uint8Array> => {
    const key = `${path} ${start}-${end}`;
    const opening = kept.get(key) ?? openFile(path).then((bytes) => bytes.subarray(start, end));
    kept.set(key, opening);
    return opening;
  };
  const sogs = new SogFiles();
  const base = 'https://trees.test/';
  const openSog = (path: string): Promise<GaussianCloud> =>
    sogs.open(sogAddress(path, 'scene', base), (url) => openFile(url.replace(base, '')));
  return { name: 'scene', budget: new LoadBudget(1e9), openFile, openIndex, openShared, openRange, openSog, opened };
}

async function openTree(bytes: Uint8Array, files: TreeFiles): Promise<SceneTree> {
  const tree = await openAny(bytes, files);
  assert.ok(tree, 'a tree');
  return tree;
}

const worldOf = ({ positions, origin }: GaussianCloud, i: number): number[] =>
  [0, 1, 2].map((axis) => positions[3 * i + axis] + origin[axis]);

/** Whether a point is in a volume, within a tolerance. */
function isWithin(volume: readonly number[], point: readonly number[], tolerance: number): boolean {
  return [3, 6, 9].every((at) => {
    const axis = volume.slice(at, at + 3);
    const length = Math.hypot(...axis);
    const along = axis.reduce((sum, x, k) => sum + (x / length) * (point[k] - volume[k]), 0);
    return Math.abs(along) <= length + tolerance;
  });
}

interface Walked {
  readonly leaves: GaussianCloud[];
  readonly nodes: number;
  readonly depth: number;
}

/** Reads all nodes, and checks that each has its splats in its volume. */
async function walk(tree: SceneTree, files: TreeFiles, tolerance = 1e-4): Promise<Walked> {
  const all: Walked & { nodes: number; depth: number } = { leaves: [], nodes: 0, depth: 0 };
  const visit = async (node: SceneNode, depth: number): Promise<void> => {
    const { cloud, found, parts, isAdded, error } = await readNode(tree, node, files);
    all.nodes++;
    all.depth = Math.max(all.depth, depth);
    for (let i = 0; i < (cloud?.count ?? 0) && node.volume; i++)
      assert.ok(isWithin(node.volume, worldOf(cloud!, i), tolerance), `splat ${i} of a node at depth ${depth}`);
    const children = [...node.children, ...found];
    assert.ok(error >= 0);
    if (cloud && (isAdded || children.length === 0)) all.leaves.push(cloud);
    else if (cloud && parts) {
      const replaced = parts.reduce((sum, count) => sum + count, 0);
      all.leaves.push({ ...cloud, count: cloud.count - replaced, positions: cloud.positions.subarray(3 * replaced) });
    }
    for (const child of children) await visit(child, depth + 1);
  };
  for (const root of tree.roots) await visit(root, 0);
  return all;
}

/** Splats in an order of their own, because trees have another. */
const sorted = (clouds: readonly GaussianCloud[]): number[][] =>
  clouds
    .flatMap((cloud) => Array.from({ length: cloud.count }, (_, i) => worldOf(cloud, i)))
    .sort((a, b) => a[0] - b[0] || a[1] - b[1]);

function assertSameSplats(found: readonly GaussianCloud[], expected: GaussianCloud, tolerance: number): void {
  const [a, b] = [sorted(found), sorted([expected])];
  assert.equal(a.length, b.length);
  const far = a.reduce((max, point, k) => Math.max(max, Math.hypot(...point.map((x, axis) => x - b[k][axis]))), 0);
  assert.ok(far <= tolerance, `${far} apart`);
}

const cloud = smallCloud(800, 1);
const LONGITUDE = 0.2;
const LATITUDE = 0.8;

/** Transform from east, north, up at a place on the Earth to earth-centered coordinates. */
function onEarth(): number[] {
  const [lon, lat] = [LONGITUDE, LATITUDE];
  const up = [Math.cos(lat) * Math.cos(lon), Math.cos(lat) * Math.sin(lon), Math.sin(lat)];
  const north = [-Math.sin(lat) * Math.cos(lon), -Math.sin(lat) * Math.sin(lon), Math.cos(lat)];
  return [-Math.sin(lon), Math.cos(lon), 0, 0, ...north, 0, ...up, 0, ...up.map((x) => 6.37e6 * x), 1];
}

for (const [name, options] of [
  ['listed one by one', {}],
  ['of subtrees', { isImplicit: true }],
  ['some in a tileset of their own', { nestedAt: 2 }],
  ['on the Earth', { transform: onEarth() }],
] as const)
  test(`tiles ${name}: the leaves are the scene, and each tile is in its volume`, async () => {
    const files = beside(splatTileset(cloud, { levels: 4, ...options }));
    const bytes = await files.openFile('tileset.json');
    const tree = await openTree(bytes, files);
    const { leaves, nodes, depth } = await walk(tree, files);
    // A point on the Earth has float32 digits of its own tile, whose corner is 4 m away at most.
    const whole = await readScene(bytes, {
      name: 'tileset.json',
      openFile: beside(splatTileset(cloud, { levels: 4, ...options })).openFile,
    });
    assertSameSplats(leaves, whole, 2e-6);
    assert.deepEqual([nodes, depth], [85, 3]);
    assert.equal(new Set(files.opened).size, files.opened.length, 'each file once');
    if ('transform' in options) assert.ok(Math.abs(Math.hypot(...tree.up!) - 1) < 1e-12);
    else assert.equal(tree.up, undefined);
  });

test('only the subtrees and tilesets above a tile are opened for it', async () => {
  for (const [options, inner] of [
    [{ isImplicit: true }, /^subtrees\/2/],
    [{ nestedAt: 2 }, /^in/],
  ] as const) {
    const files = beside(splatTileset(cloud, { levels: 4, ...options }));
    const tree = await openTree(await files.openFile('tileset.json'), files);
    const root = await readNode(tree, tree.roots[0], files);
    const [child] = [...tree.roots[0].children, ...root.found];
    const below = await readNode(tree, child, files);
    assert.ok(!files.opened.some((path) => inner.test(path)), files.opened.join(' '));
    await readNode(tree, [...child.children, ...below.found][0], files);
    assert.equal(files.opened.filter((path) => inner.test(path)).length, 'isImplicit' in options ? 2 : 1);
  }
});

test('regions and spheres bound their tiles; a part of an implicit region is a part of it', async () => {
  const [lon, lat] = [LONGITUDE, LATITUDE];
  const [west, south, east, north] = [lon - 1e-5, lat - 1e-5, lon + 1e-5, lat + 1e-5];
  const region = [west, south, east, north, -30, 50];
  const at = (root: object): Promise<SceneTree> => {
    const text = JSON.stringify({ asset: { version: '1.1' }, geometricError: 9, root });
    return openTree(new TextEncoder().encode(text), beside(new Map()));
  };
  const volumeOf = async (root: object): Promise<readonly number[]> => (await at(root)).roots[0].volume!;
  const volume = await volumeOf({ boundingVolume: { region }, geometricError: 1 });
  // Points of the ellipsoid, after its definition by the semi-axes of WGS 84.
  const [a, b] = [6_378_137, 6_356_752.314_245];
  for (const [x, y, h] of [
    [west, south, -30],
    [east, north, 50],
    [lon, lat, 0],
    [west, north, 50],
  ]) {
    const n = a ** 2 / Math.hypot(a * Math.cos(y), b * Math.sin(y));
    const earth = [
      (n + h) * Math.cos(y) * Math.cos(x),
      (n + h) * Math.cos(y) * Math.sin(x),
      ((b / a) ** 2 * n + h) * Math.sin(y),
    ];
    const point = [-earth[0], -earth[2], -earth[1]];
    assert.ok(isWithin(volume, point, 1e-3), `${[x, y, h].join(' ')}`);
    assert.ok(Math.hypot(...point.map((value, k) => value - volume[k])) <= volume[12] + 1e-3);
  }
  const sides = [3, 6, 9].map((from) => Math.hypot(...volume.slice(from, from + 3)));
  assert.ok(Math.abs(sides[2] - 40) < 0.1 && Math.abs(sides[1] - 63.7) < 0.5, sides.join(' '));
  const scaled = {
    transform: [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 5, 7, 1, 1],
    boundingVolume: { sphere: [1, 0, 0, 3] },
    geometricError: 1,
  };
  const sphere = await volumeOf(scaled);
  assert.deepEqual([...sphere.slice(0, 3), Math.round(1e9 * sphere[12]) / 1e9], [-7, -1, -7, 6]);
});

test('a cell of LCC is a chain of levels, and only ranges of its files are read', async () => {
  const levels = [800, 200, 50].map((count) => smallCloud(count, 3, count));
  const files = beside(new Map(Object.entries(writeLcc(levels, { cellSize: 200, environment: smallCloud(7, 3, 5) }))));
  const tree = await openTree(await files.openFile('meta.lcc'), files);
  assert.deepEqual([tree.container, tree.roots.length, tree.up], ['lcc', 5, [0, 0, 1]]);
  const { leaves, nodes } = await walk(tree, files);
  assert.equal(
    leaves.reduce((sum, { count }) => sum + count, 0),
    807,
  );
  assert.equal(nodes, 4 + 1 + 1 + 1);
});

test('nodes of LCC2 have their boxes and their part of a file, which is read once', async () => {
  const written = new Map(Object.entries(writeLcc2(cloud, { levels: 3, environment: smallCloud(7, 1, 5) })));
  const files = beside(written);
  const bytes = written.get('scene.lcc2')!;
  const tree = await openTree(bytes, files);
  assert.deepEqual([tree.container, tree.roots.length, tree.up], ['lcc2', 3, [0, 0, 1]]);
  // Positions have 16 bits of a logarithm.
  const { leaves, nodes, depth } = await walk(tree, files, 1e-3);
  assert.deepEqual([nodes, depth], [2 + 4 + 8 + 1, 2]);
  assert.deepEqual(files.opened.toSorted(), [...written.keys()].slice(1).toSorted(), 'each file once');
  const { openFile } = beside(written);
  assertSameSplats(leaves, await readScene(bytes, { name: 'scene.lcc2', openFile }), 0);
});

test('LCC2 without the file of its surroundings says so; one whose nodes have no boxes is no tree', async () => {
  const written = new Map(Object.entries(writeLcc2(cloud, { levels: 2, environment: smallCloud(7, 1, 5) })));
  const bytes = written.get('scene.lcc2')!;
  written.delete('data/3dgs/env.sog');
  const files = beside(written);
  const tree = await openTree(bytes, files);
  const around = await readNode(tree, tree.roots.at(-1)!, files);
  assert.equal(around.cloud!.count, 0);
  assert.match(around.cloud!.warnings!.join(), /surroundings \(data\/3dgs\/env\.sog\) are left out/);
  const changed = (from: RegExp, to: string): Uint8Array =>
    new TextEncoder().encode(new TextDecoder().decode(bytes).replace(from, to));
  assert.equal(await openAny(changed(/"boundingBox":/, '"box":'), files), undefined);
  await assert.rejects(openAny(changed(/"count":\d+/, '"count":-1'), files), /data\.3dgs.*whole numbers/);
  const beyond = await openTree(changed(/"start":0/, '"start":9999'), files);
  await assert.rejects(readNode(beyond, beyond.roots[0], files), /decode\/corrupt|runs within/);
  const long = 'a'.repeat(2000);
  const many = `{"totalLevels":1,"root":{"splatFiles":["${long}"],"child":[${Array(3000).fill('{"data":{"3dgs":{"name":0}}}').join()}]}}`;
  await assert.rejects(openAny(new TextEncoder().encode(many), files), /nodes of at most/);
});

const stones = smallCloud(16_384, 1);
const HEAD_BYTES = 512;

test('RAD is read by chunks: the leaves are the scene, and a page replaces its part of the page above', async () => {
  const bytes = writeRadTree(stones, { chunkSize: 1024 });
  const files = beside(new Map([['scene.rad', bytes]]));
  const tree = await openTree(bytes.subarray(0, HEAD_BYTES), files);
  assert.deepEqual([tree.container, tree.roots.length], ['rad', 1]);
  const { leaves, nodes, depth } = await walk(tree, files);
  assert.ok(nodes > 8 && depth > 1, `${nodes} nodes, ${depth} deep`);
  const whole = await readScene(bytes, { name: 'scene.rad' });
  const all = leaves.reduce((sum, { count }) => sum + count, 0);
  assert.equal(all, whole.count);
  assertSameSplats(leaves, whole, 0);
  // The description, whose beginning was given, and each chunk.
  assert.equal(files.opened.length, 1 + Math.ceil((whole.count * 4) / 3 / 1024));
});

test('the first page of a RAD needs its first chunks alone', async () => {
  const bytes = writeRadTree(stones, { chunkSize: 4096 });
  const files = beside(new Map([['scene.rad', bytes]]));
  const tree = await openTree(bytes, files);
  const { cloud: first, parts, found } = await readNode(tree, tree.roots[0], files);
  assert.equal(files.opened.length, 1);
  assert.ok(first!.count > 1000 && parts!.length === found.length && found.length > 1, `${parts!.join(' ')}`);
  await readNode(tree, found[0], files);
  assert.equal(files.opened.length, 2);
});

test('a RAD without levels is no tree; one whose tree has a loop is refused', async () => {
  const flat = writeRadTree(stones, { chunkSize: 4096, isFlat: true });
  assert.equal(await openAny(flat, beside(new Map([['scene.rad', flat]]))), undefined);
  const bytes = writeRadTree(stones, { chunkSize: 4096 });
  // The first child of the root, 1, is the first number of its property.
  const view = new DataView(bytes.buffer);
  const after = (at: number): number => at + 8 + 8 * Math.ceil(view.getUint32(at + 4, true) / 8);
  const chunk = after(0);
  const text = new TextDecoder().decode(bytes.subarray(chunk, after(chunk)));
  const { offset } = JSON.parse(/\{[^{}]*"child_start"[^{}]*\}/.exec(text)![0]) as { offset: number };
  const at = after(chunk) + 8 + offset;
  assert.equal(view.getUint32(at, true), 1);
  view.setUint32(at, 0, true);
  const files = beside(new Map([['scene.rad', bytes]]));
  const looped = await openTree(bytes, files);
  await assert.rejects(readNode(looped, looped.roots[0], files), /child_start.*expected an index from 1 to/);
  await assert.rejects(readScene(bytes, { name: 'scene.rad', maxSplats: 1000 }), /child_start/);
});

test('a limit of splats chooses a cut through the tree of a RAD', async () => {
  const bytes = writeRadTree(stones, { chunkSize: 4096 });
  for (const maxSplats of [1, 1000, 5000, 16_384]) {
    const { count } = await readScene(bytes, { name: 'scene.rad', maxSplats });
    assert.ok(count <= maxSplats && count > 0.6 * maxSplats, `${count} of ${maxSplats}`);
  }
});
