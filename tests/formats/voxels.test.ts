/**
 * Floors of voxels, as splat-transform writes them: read, turned, and bounded in work.
 * SECURITY.md: "The size of a file bounds its cost".
 */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Vector3 } from '@gaussian-splat/core';
import { floorAt, floorOf, readVoxels, type FloorOptions, type VoxelFiles } from '@gaussian-splat/formats/floor';
import { FRAME } from './support/floor-room.js';

/** The octree of solid voxels as splat-transform lays it out: nodes breadth first, a mask of 64 bits for each block that is not all of one kind. */
function voxelFiles(isSolid: (x: number, y: number, z: number) => boolean, blocks: Vector3, depth: number): VoxelFiles {
  const voxel = 0.05;
  const nodes: number[] = [];
  const masks: number[] = [];
  const within = (x: number, y: number, z: number): boolean =>
    x < 4 * blocks[0] && y < 4 * blocks[1] && z < 4 * blocks[2] && isSolid(x, y, z);
  interface Node {
    readonly level: number;
    readonly at: Vector3;
  }
  const shareOf = ({ level, at }: Node): 'none' | 'some' | 'all' => {
    const edge = 4 * 2 ** level;
    let [solid, all] = [0, 0];
    for (let z = 0; z < edge; z++)
      for (let y = 0; y < edge; y++)
        for (let x = 0; x < edge; x++, all++) if (within(at[0] + x, at[1] + y, at[2] + z)) solid++;
    return solid === 0 ? 'none' : solid === all ? 'all' : 'some';
  };
  const queue: Node[] = [{ level: depth, at: [0, 0, 0] }];
  let next = 1;
  for (const node of queue) {
    if (shareOf(node) === 'all') nodes.push(0xff000000);
    else if (node.level === 0) {
      const words = [0, 0];
      for (let bit = 0; bit < 64; bit++) {
        const [x, y, z] = [bit & 3, (bit >> 2) & 3, bit >> 4].map((value, k) => value + node.at[k]);
        if (within(x, y, z)) words[bit >> 5] |= 1 << (bit & 31);
      }
      nodes.push(masks.length / 2);
      masks.push(...words);
    } else {
      let mask = 0;
      const first = next;
      for (let octant = 0; octant < 8; octant++) {
        const half = 2 * 2 ** node.level;
        const at = node.at.map((value, k) => value + half * ((octant >> k) & 1)) as unknown as Vector3;
        const child = { level: node.level - 1, at };
        if (shareOf(child) === 'none') continue;
        mask |= 1 << octant;
        queue.push(child);
        next++;
      }
      nodes.push(((mask << 24) | first) >>> 0);
    }
  }
  const min = [-1, -0.3, -2];
  const head = {
    ...{ version: '1.1', voxelResolution: voxel, leafSize: 4, treeDepth: depth },
    gridBounds: { min, max: min.map((value, k) => value + 4 * voxel * blocks[k]) },
    ...{ nodeCount: nodes.length, leafDataCount: masks.length },
  };
  return {
    head: new TextEncoder().encode(JSON.stringify(head)),
    tree: new Uint8Array(Uint32Array.from([...nodes, ...masks]).buffer),
    name: 'room.voxel.json',
  };
}

/** A floor of 30 cm under 2.4 m of air between walls, 4 by 6 m, with a pillar at one side, in voxels of 5 cm: y up, as PlayCanvas has it. */
const isWall = (x: number, y: number, z: number): boolean =>
  y < 6 || x < 4 || x >= 76 || z < 4 || z >= 116 || (x >= 60 && x < 68 && z >= 20 && z < 28);
const VOXELS = voxelFiles(isWall, [20, 14, 30], 5);

test('voxels of splat-transform are a floor, turned to where the splats of the file are', () => {
  const { grid, solid } = readVoxels(VOXELS, FRAME, 1);
  assert.deepEqual(grid.size, [80, 56, 120]);
  const map = floorOf(grid, solid, { height: 1.7, near: [-1, 1.6, 0] });
  // The frame of PlayCanvas is that of the file turned about z, and ours is that turned about x: x and z change their signs.
  assert.ok(Math.abs(floorAt(map, -1, -1, 0)! - (-0.3 + 5.5 * 0.05)) < 1e-6, `${floorAt(map, -1, -1, 0)}`);
  const pillar = [-(-1 + 64 * 0.05), -(-2 + 24 * 0.05)];
  assert.equal(floorAt(map, pillar[0], pillar[1], 0), undefined);
  assert.ok(floorAt(map, -pillar[0] - 2, pillar[1], 0) !== undefined, 'the other side is free');
  const free = (80 - 8 - 8) * (120 - 8 - 8) * 0.0025;
  assert.ok(map.area > 0.9 * free && map.area <= free + 1, `${map.area} of ${free} m²`);
  const turned = readVoxels({ ...VOXELS, head: edited({ version: '1.0' }) }, FRAME, 0.5);
  assert.equal(turned.grid.voxel, 0.025);
});

function edited(changes: object): Uint8Array {
  const head: object = JSON.parse(new TextDecoder().decode(VOXELS.head));
  return new TextEncoder().encode(JSON.stringify({ ...head, ...changes }));
}

test('voxels cost what they weigh, and the page limits their memory and seconds', () => {
  // A tree of one solid node.
  const tree = new Uint8Array(Uint32Array.of(0xff000000).buffer);
  const voxel = { min: [-8, -4, -8], max: [8, 4, 8] };
  const large = edited({ gridBounds: voxel, treeDepth: 8, nodeCount: 1, leafDataCount: 0 });
  const read = (limits?: VoxelFiles['limits'], frame = FRAME): unknown =>
    readVoxels({ ...VOXELS, head: large, tree, limits }, frame, 1);
  const half = Math.SQRT1_2;
  const turned: FloorOptions['frame'] = [
    [half, 0, half],
    [0, 1, 0],
    [-half, 0, half],
  ];
  assert.throws(() => read({}, turned), { code: 'out-of-memory/budget' });
  assert.throws(() => read({ maxBytes: 1e6 }), { code: 'out-of-memory/budget' });
  assert.throws(() => read({ maxSeconds: 0 }), { code: 'out-of-memory/budget' });
});

test('voxels that contradict themselves are refused by name', () => {
  const words = new Uint32Array(VOXELS.tree.slice().buffer);
  const withNode = (at: number, word: number): Uint8Array => {
    const own = words.slice();
    own[at] = word;
    return new Uint8Array(own.buffer);
  };
  const cases: readonly (readonly [string, Partial<VoxelFiles>, RegExp])[] = [
    ['a later version', { head: edited({ version: '2.0' }) }, /^decode\/unsupported.*version/],
    ['no bounds', { head: edited({ gridBounds: undefined }) }, /^decode\/header.*gridBounds/],
    ['another block', { head: edited({ leafSize: 8 }) }, /^decode\/header.*leafSize/],
    ['endless voxels', { head: edited({ treeDepth: 20, voxelResolution: 1e-5 }) }, /^decode\/unsupported.*voxels/],
    ['a cut tree', { tree: VOXELS.tree.subarray(8) }, /^decode\/corrupt/],
    ['a child before its parent', { tree: withNode(1, 0xff000001) }, /^decode\/corrupt.*node 1/],
    ['a child behind the end', { tree: withNode(0, 0xffffffff) }, /^decode\/corrupt.*node 0/],
    ['a mask behind the end', { tree: withNode(0, 0x00ffffff) }, /^decode\/corrupt.*node 0/],
    ['no JSON', { head: new Uint8Array(9) }, /^decode\//],
  ];
  for (const [name, files, expected] of cases) {
    let said = 'nothing';
    try {
      readVoxels({ ...VOXELS, ...files }, FRAME, 1);
    } catch (error) {
      said = `${(error as { code: string }).code} ${(error as Error).message}`;
    }
    assert.match(said, expected, name);
  }
});
