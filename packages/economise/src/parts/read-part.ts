import type { GaussianCloud } from '@gaussian-splat/core';
import { readSplats } from '@gaussian-splat/formats';
import { putCloud, type Columns, type Part } from './cloud-memory.js';

/** So many splats are read at once: few enough for their numbers to be in the cache still when they are put in their places. */
const BLOCK = 1 << 14;

/** What a part was found to hold. */
export interface PartRead {
  /** Splats that can be drawn; they stand together at the beginning of the part's places. */
  readonly count: number;
  readonly antialiased: boolean;
  readonly filterVariance: number | undefined;
  readonly hints: GaussianCloud['hints'];
  /** Of its splats: see `GaussianCloud.faults`. */
  readonly faults: readonly number[];
  /** Of the file: see `GaussianCloud.warnings`. */
  readonly warnings: readonly string[];
}

/** Reads a part of a file block by block into columns, the places of the part's splats there being their numbers in the file. */
export async function readBlocks(
  { first, end }: Part,
  to: Columns,
  read: (block: Part) => Promise<GaussianCloud | undefined>,
): Promise<PartRead> {
  let [count, antialiased] = [0, false];
  let filterVariance: number | undefined;
  let hints: GaussianCloud['hints'];
  const faults = [0, 0, 0, 0];
  const warnings = new Set<string>();
  for (let at = first; at < end; at += BLOCK) {
    const cloud = await read({ first: at, end: Math.min(end, at + BLOCK) });
    if (cloud === undefined) continue;
    putCloud(cloud, to, first + count);
    count += cloud.count;
    antialiased ||= cloud.antialiased;
    filterVariance ??= cloud.filterVariance;
    hints ??= cloud.hints;
    cloud.faults?.forEach((number, k) => (faults[k] += number));
    for (const warning of cloud.warnings ?? []) warnings.add(warning);
  }
  return { count, antialiased, filterVariance, hints, faults, warnings: [...warnings] };
}

/** Reads a part of a file that lies in memory. */
export function readPart(input: {
  readonly bytes: Uint8Array;
  readonly name: string;
  readonly part: Part;
  readonly to: Columns;
}): Promise<PartRead> {
  const { bytes, name, part, to } = input;
  return readBlocks(part, to, (block) => readSplats(bytes, block, name));
}
