import type { FilterRule, GaussianCloud } from '@gaussian-splat/core';
import { readSplats } from '@gaussian-splat/formats';
import { putCloud, type Columns, type Part } from './cloud-memory.js';

/** Number of splats that are read at once, so that they remain in the cache until they are copied. */
const BLOCK = 1 << 14;

/** Result of reading a part of a file. */
export interface PartRead extends FilterRule {
  /** Number of usable splats, which are contiguous from the beginning of the part's range. */
  readonly count: number;
  readonly hints: GaussianCloud['hints'];
  /** Number of unusable splats by reason; see `GaussianCloud.faults`. */
  readonly faults: readonly number[];
  /** Warnings about the file; see `GaussianCloud.warnings`. */
  readonly warnings: readonly string[];
}

/**
 * Reads a part of a file by blocks into arrays of the whole scene, from index `first` on.
 * @param read Returns the usable splats of a block; undefined if it has none.
 */
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

/** Reads a part of a file whose bytes are in memory. */
export function readPart(input: {
  readonly bytes: Uint8Array;
  readonly name: string;
  readonly part: Part;
  readonly to: Columns;
}): Promise<PartRead> {
  const { bytes, name, part, to } = input;
  return readBlocks(part, to, (block) => readSplats(bytes, block, name));
}
