/** A writer of LCC2 with levels, after version 0.0.3 of its white paper. It shares no code with the reader, and runs in pages. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { zipSync } from 'fflate';
import { pick } from '../../support/lod-folder.js';
import { writeSog } from './sog-writer.js';

interface Options {
  /** The coarsest level has two nodes, each finer one twice as many, and four times as many splats. */
  readonly levels: number;
  /** Splats around the scene. */
  readonly environment?: GaussianCloud;
}

interface Region {
  readonly indices: readonly number[];
  readonly below: readonly Region[];
}

/** Halves splats along x, y, x, and so on. */
function divided(cloud: GaussianCloud, indices: readonly number[], depth: number, axis = 0): Region[] {
  if (depth === 0) return [];
  const sorted = indices.toSorted((a, b) => cloud.positions[3 * a + axis] - cloud.positions[3 * b + axis]);
  const middle = sorted.length >> 1;
  return [sorted.slice(0, middle), sorted.slice(middle)].map((half) => ({
    indices: half,
    below: divided(cloud, half, depth - 1, 1 - axis),
  }));
}

/** Files of a scene by their paths. Neighboring nodes of a level share a file: there are two for each level. */
export function writeLcc2(cloud: GaussianCloud, { levels, environment }: Options): Record<string, Uint8Array> {
  const files: Record<string, Uint8Array> = {};
  const paths: string[] = [];
  const put = (path: string, part: GaussianCloud): number => {
    files[path] = zipSync(writeSog(part), { level: 0 });
    return paths.push(path) - 1;
  };
  let regions = divided(cloud, [...Array(cloud.count).keys()], levels);
  const child: Record<string, object> = {};
  let above: Record<string, object>[] = [child, child];
  for (let depth = 1; regions.length > 0; depth++) {
    const step = 4 ** (levels - depth);
    const own = regions.map(({ indices }) => indices.filter((_, k) => k % step === 0));
    const next: Record<string, object>[] = [];
    for (const half of [0, 1]) {
      const first = (half * regions.length) / 2;
      const nodes = own.slice(first, first + regions.length / 2);
      const name = put(`data/3dgs/${depth}-${half}.sog`, pick(cloud, nodes.flat(), 2 ** (levels - depth)));
      let start = 0;
      nodes.forEach((indices, k) => {
        const place = (axis: number): number[] => regions[first + k].indices.map((i) => cloud.positions[3 * i + axis]);
        const corner = (of: (...numbers: number[]) => number): number[] => [0, 1, 2].map((axis) => of(...place(axis)));
        const below: Record<string, object> = {};
        above[depth === 1 ? half : (first + k) >> 1][(first + k) & 1] = {
          ...{ boundingBox: { min: corner(Math.min), max: corner(Math.max) } },
          ...{ data: { '3dgs': { name, start, count: indices.length } }, child: below },
        };
        next.push(below);
        start += indices.length;
      });
    }
    regions = regions.flatMap(({ below }) => below);
    above = next;
  }
  const env = environment && { env: { name: put('data/3dgs/env.sog', environment) } };
  const meta = { version: '0.0.3', totalLevels: levels, splatType: '.sog', root: { data: env ?? null, child } };
  const description = { ...meta, root: { ...meta.root, splatFiles: paths } };
  return { 'scene.lcc2': new TextEncoder().encode(JSON.stringify(description)), ...files };
}
