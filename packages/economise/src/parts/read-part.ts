import type { GaussianCloud } from '@gaussian-splat/core';
import { readSplats } from '@gaussian-splat/formats';
import { putCloud, type Columns, type Part } from './cloud-memory.js';

/** Splats read at once: few enough to stay in the cache until they are copied. */
const BLOCK = 1 << 14;

/** Result of reading a part. */
export interface PartRead {
  /** Number of usable splats; they are contiguous at the beginning of the part's range. */
  readonly count: number;
  readonly antialiased: boolean;
  readonly filterVariance: number | undefined;
  readonly hints: GaussianCloud['hints'];
  /** Faults of its splats: see `GaussianCloud.faults`. */
  readonly faults: readonly number[];
  /** Warnings of the file: see `GaussianCloud.warnings`. */
  readonly warnings: readonly string[];
}

/** Reads a part of a file block by block into columns, at the indices of its splats in the file. */
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

/** Reads a part of a file in memory. */
export function readPart(input: {
  readonly bytes: Uint8Array;
  readonly name: string;
  readonly part: Part;
  readonly to: Columns;
}): Promise<PartRead> {
  const { bytes, name, part, to } = input;
  return readBlocks(part, to, (block) => readSplats(bytes, block, name));
}
