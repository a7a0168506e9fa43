import type { GaussianCloud } from '@gaussian-splat/core';
import { MAX_DROPPED_RATIO, readScene, splatRanges, type SplatRanges } from '@gaussian-splat/formats';
import { allocateColumns, closeGaps, type Columns } from './cloud-memory.js';
import type { PartRead } from './read-part.js';
import type { Part } from './cloud-memory.js';
import { partsOf, poolFor, type TaskPool } from './task-pool.js';

/** Reads the bytes of a scene file as `readScene` does, by parallel tasks if its format and the pool allow it. */
export async function readInParts(
  bytes: Uint8Array,
  options: { readonly name: string; readonly signal?: AbortSignal },
  pool: TaskPool,
): Promise<GaussianCloud> {
  const { name, signal } = options;
  if (pool.size > 1 && pool.shares(bytes.buffer)) {
    const ranges = await splatRanges(bytes, name);
    const readAll = (parts: readonly Part[], to: Columns): Promise<PartRead[]> =>
      pool.run(
        'readPart',
        parts.map((part) => ({ bytes, name, part, to })),
      );
    const cloud = ranges && (await gatherParts(ranges, pool, readAll));
    signal?.throwIfAborted();
    if (cloud) return cloud;
  }
  return readScene(bytes, options);
}

/**
 * Reads the splats of a file by parts into memory of a pool.
 * @param readAll Reads parts into arrays, as `readBlocks` does.
 * @returns The cloud. Undefined if the scene is too small for parts, or too many splats are unusable; the caller then
 * reads the whole file, which reports the reasons.
 */
export async function gatherParts(
  { count, shDegree }: SplatRanges,
  pool: TaskPool,
  readAll: (parts: readonly Part[], to: Columns) => Promise<readonly PartRead[]>,
): Promise<GaussianCloud | undefined> {
  const parts = partsOf(count, poolFor(pool, count));
  if (parts.length <= 1) return undefined;
  const columns = allocateColumns(count, shDegree, pool);
  const read = await readAll(parts, columns);
  const kept = closeGaps(
    columns,
    read.map((part, k) => ({ first: parts[k].first, count: part.count })),
  );
  const droppedCount = count - kept.count;
  if (droppedCount > MAX_DROPPED_RATIO * count) return undefined;
  const antialiased = read.some((part) => part.antialiased);
  return {
    ...kept,
    origin: [0, 0, 0],
    antialiased,
    filterVariance: read.find((part) => part.filterVariance !== undefined)?.filterVariance,
    hints: read.find((part) => part.hints !== undefined)?.hints,
    droppedCount,
    ...(droppedCount > 0 && {
      faults: read[0].faults.map((_, k) => read.reduce((sum, { faults }) => sum + faults[k], 0)),
    }),
    warnings: [...new Set(read.flatMap(({ warnings }) => warnings))],
  };
}
