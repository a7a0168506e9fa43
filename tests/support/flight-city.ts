/**
 * Makes a tileset of side x side copies of the skull: each copy is a nested tileset of three levels, under a tree of tiles
 * with splats of their own. A server leaves out folders "~K" of addresses, which give each copy files of its own in 25 MB.
 */
import { readFileSync } from 'node:fs';
import { readScene } from '@gaussian-splat/formats';
import { pick } from './lod-folder.js';
import { splatGlb, splatTileset } from './tileset.js';

/** Parameters of the flight: splats in the finest level, center and half of the width in the axes of the element. */
export interface City {
  /** Files by their paths. */
  readonly files: ReadonlyMap<string, Uint8Array>;
  readonly splats: number;
  readonly center: readonly [number, number, number];
  readonly half: number;
}

/** Copies along a side of a block, from the finest block. The coarsest blocks are as many as the city needs. */
const BLOCKS = [2, 4, 8];

/** @param blocks Coarsest blocks of 8 x 8 copies along a side: 3 for 576 copies, 50 million splats. */
export async function makeCity(skullFile: string, blocks: number): Promise<City> {
  const files = new Map<string, Uint8Array>();
  const read = await readScene(new Uint8Array(readFileSync(skullFile)), { name: 'skull.spz' });
  const { count } = read;
  const numbers = read.sh.length / count;
  // From a cloud to glTF: half a turn about z. Colors only.
  const skull = {
    ...read,
    positions: read.positions.map((x, k) => (k % 3 === 2 ? x : -x)),
    rotations: Float32Array.from({ length: 4 * count }, (_, k) => {
      const [w, x, y, z] = read.rotations.subarray(4 * (k >> 2), 4 * (k >> 2) + 4);
      return [-z, -y, x, w][k & 3];
    }),
    shDegree: 0 as const,
    sh: Float32Array.from({ length: 3 * count }, (_, k) => read.sh[numbers * Math.floor(k / 3) + (k % 3)]),
  };
  const tiles = splatTileset(skull, { levels: 3 });
  for (const [path, bytes] of tiles) files.set(`skull/${path}`, bytes);
  const inner = JSON.parse(new TextDecoder().decode(tiles.get('tileset.json'))) as {
    geometricError: number;
    root: { boundingVolume: { box: number[] } };
  };
  const { box } = inner.root.boundingVolume;
  const pitch = 2.1 * Math.max(box[3], box[7]);
  const side = 8 * blocks;
  /** Adds a block of n x n copies with the splats of one. */
  const putBlock = (n: number): void => {
    const few = pick(
      skull,
      Array.from({ length: Math.ceil(count / n ** 2) }, (_, k) => k * n ** 2),
      n,
    );
    const repeat = (values: Float32Array): Float32Array =>
      Float32Array.from({ length: values.length * n ** 2 }, (_, k) => values[k % values.length]);
    const { scales, rotations, opacities, sh, positions } = few;
    const copies = {
      ...few,
      count: few.count * n ** 2,
      positions: repeat(positions).map((x, k) => {
        const copy = Math.floor(k / positions.length);
        return x + [pitch * (copy % n), 0, -pitch * Math.floor(copy / n)][k % 3];
      }),
      ...{ scales: repeat(scales), rotations: repeat(rotations), opacities: repeat(opacities), sh: repeat(sh) },
    };
    files.set(`block-${n}.glb`, splatGlb(copies));
  };
  for (const n of [...BLOCKS, side]) putBlock(n);
  const volume = (n: number): object => {
    const more = ((n - 1) * pitch) / 2;
    return {
      box: [box[0] + more, box[1] + more, box[2], box[3] + more, 0, 0, 0, box[7] + more, 0, 0, 0, box[11]],
    };
  };
  let copies = 0;
  const tile = (n: number, x: number, y: number): object => {
    const name = `~${copies++}`;
    const transform = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, 0, 1];
    const own = { transform, boundingVolume: volume(n), geometricError: n * inner.geometricError };
    if (n === 1) return { ...own, content: { uri: `${name}/skull/tileset.json` } };
    const half = n / 2;
    const children = [0, 1, 2, 3].map((k) => tile(half, (k & 1) * half * pitch, (k >> 1) * half * pitch));
    return { ...own, refine: 'REPLACE', content: { uri: `${name}/block-${n}.glb` }, children };
  };
  const children = Array.from({ length: blocks ** 2 }, (_, k) =>
    tile(8, 8 * pitch * (k % blocks), 8 * pitch * Math.floor(k / blocks)),
  );
  const geometricError = side * inner.geometricError;
  const root = {
    ...{ boundingVolume: volume(side), geometricError, refine: 'REPLACE' },
    ...{ content: { uri: `block-${side}.glb` }, children },
  };
  const tileset = JSON.stringify({ asset: { version: '1.1' }, geometricError, root });
  files.set('tileset.json', new TextEncoder().encode(tileset));
  const middle = ((side - 1) / 2) * pitch;
  // The element's axes: those of glTF, turned by half about y.
  return {
    files,
    splats: side ** 2 * count,
    center: [-(box[0] + middle), box[2], box[1] + middle],
    half: (side / 2) * pitch,
  };
}
