import { GaussianSplatError, keepUsable, type GaussianCloud } from '@gaussian-splat/core';
import { LoadBudget } from './budget.js';
import { plainBytes, type FileBytes } from './bytes.js';
import { formatOf, loadReader } from './load-files.js';
import type { ReadSceneOptions } from './read-scene.js';

/**
 * Reads the available splats of a file that is still loading. PLY, compressed PLY, .splat and .ksplat give all complete
 * splats. SPZ and compressed PLY give all splats without view-dependent color, if only this color is missing.
 *
 * @param beginning The first bytes of the file.
 * @returns The splats in the order of the file; undefined if none is complete, if the bytes are invalid, or if the
 * format cannot be read in part. `readScene` reports invalid bytes when the file is complete.
 * @throws The reason of `signal`, or GaussianSplatError `argument/value` if `beginning` is not bytes.
 */
export async function readPrefix(
  beginning: FileBytes,
  options: ReadSceneOptions = {},
): Promise<GaussianCloud | undefined> {
  const { name = 'scene', contentType = '', signal } = options;
  signal?.throwIfAborted();
  const bytes = plainBytes(beginning, name);
  const format = bytes.length === 0 ? undefined : await formatOf(bytes, name, contentType);
  if (!format?.readsPrefix) return undefined;
  const read = await loadReader(format);
  try {
    const budget = new LoadBudget(bytes.length, options);
    const cloud = keepUsable(await read({ bytes, name, budget, signal, isPrefix: true }));
    return cloud.count > 0 ? cloud : undefined;
  } catch (error) {
    signal?.throwIfAborted();
    if (error instanceof GaussianSplatError) return undefined;
    throw error;
  }
}
