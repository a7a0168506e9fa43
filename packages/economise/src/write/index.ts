import { GaussianSplatError } from '@gaussian-splat/core';
import type { ReducedCloud } from '../reduce.js';
import type { TaskPool } from '../parts/task-pool.js';
import { writeGlb } from './glb.js';
import { writePly } from './ply.js';
import { writeSpz } from './spz.js';

/** A way to write a scene: how precise, and how. */
export interface Encoding {
  /** For people. */
  readonly title: string;
  /** @param pool does what can be done in parts; the file then lies in its memory */
  readonly write: (reduced: ReducedCloud, pool?: TaskPool) => Uint8Array | Promise<Uint8Array>;
}

const spz = (shBits: number): Encoding => ({
  title: `SPZ version 3, spherical harmonics of ${shBits} bits`,
  write: ({ cloud }) => writeSpz(cloud, { shBits }),
});

/** Ways to write each kind of file, the smallest first. */
const ENCODINGS: ReadonlyMap<string, readonly Encoding[]> = new Map([
  ['.spz', [spz(4), spz(5), spz(6), spz(8)]],
  ['.glb', [{ title: 'GLB, a primitive for each degree', write: writeGlb }]],
  ['.ply', [{ title: 'PLY, float32', write: ({ cloud }: ReducedCloud) => writePly(cloud) }]],
]);

/** The ways to write a file of this name. Throws `argument/value` for a name whose extension is none of ours. */
export function encodingsFor(name: string): readonly Encoding[] {
  const extension = /\.[a-z]+$/i.exec(name)?.[0].toLowerCase() ?? '';
  const found = ENCODINGS.get(extension);
  if (found) return found;
  throw new GaussianSplatError('argument/value', {
    where: name,
    expected: `a name that ends in ${[...ENCODINGS.keys()].join(', ')}`,
    found: extension || 'no extension',
    remedy: 'choose .glb for accuracy, .spz for size, .ply for tools that know nothing else',
  });
}
