import { openSync, closeSync, fstatSync, readSync } from 'node:fs';
import { gatherParts } from '@gaussian-splat/optimize/parts';
import { HEADER_BYTES, splatRanges } from '@gaussian-splat/formats';
import { readInThread } from './scene-thread.mjs';

/**
 * Starts to read a scene file on other threads, as a cloud in shared memory. If its splats can be read in ranges, as those
 * of a large PLY, all threads of the pool read them. The work continues even if this thread is busy.
 * @returns {Promise<{cloud: Promise<GaussianCloud>}>} Resolves after the start. Both promises reject as `readScene` does,
 * or with a file system error.
 */
export async function startReading(path, pool) {
  const found = pool.size > 1 ? await rangesOf(path) : undefined;
  const readAll = (parts, to) => readRows(path, found, parts, to, pool);
  const inParts = found && gatherParts(found.ranges, pool, readAll);
  return { cloud: inParts ? inParts.then((cloud) => cloud ?? readInThread(path)) : readInThread(path) };
}

function readRows(path, { head, ranges }, parts, to, pool) {
  const rowBytes = ranges.rows.byteLength;
  const inputs = parts.map((part) => ({ path, head, rowBytes, part, to }));
  return pool.run('readFilePart', inputs);
}

/**
 * Returns the location of the rows of a file, and the bytes before them. Undefined if the file is incomplete, invalid, or
 * cannot be read in ranges; reading the whole file then reports its faults.
 */
export async function rangesOf(path) {
  const { beginning, size } = readBeginning(path);
  const ranges = await splatRanges(beginning, path).catch(() => undefined);
  if (ranges?.rows === undefined) return undefined;
  const { start, byteLength } = ranges.rows;
  return start + byteLength * ranges.count <= size ? { head: beginning.slice(0, start), ranges } : undefined;
}

function readBeginning(path) {
  const file = openSync(path);
  try {
    const { size } = fstatSync(file);
    const bytes = new Uint8Array(Math.min(size, HEADER_BYTES));
    return { beginning: bytes.subarray(0, readSync(file, bytes, 0, bytes.length, 0)), size };
  } finally {
    closeSync(file);
  }
}
