import { GaussianSplatError, keepUsable, type GaussianCloud } from '@gaussian-splat/core';
import { LoadBudget } from './budget.js';
import { plainBytes, type FileBytes } from './bytes.js';
import { findFormat } from './detect.js';
import { loadReader } from './load-parts.js';
import type { ReadSceneOptions } from './read-scene.js';

/**
 * Reads the available splats of a file that is still loading: complete splats (PLY, compressed PLY, .splat, .ksplat),
 * or all splats without their view-dependent colors once only these are missing (SPZ, compressed PLY).
 *
 * @param beginning The first bytes of the file.
 * @returns The splats in the order of the file, or undefined if there are none yet or the format cannot be read in
 * part. Never throws for invalid bytes: `readScene` reports them once the file is complete.
 */
export async function readPrefix(
  beginning: FileBytes,
  options: ReadSceneOptions = {},
): Promise<GaussianCloud | undefined> {
  const { name = 'scene', contentType = '', signal } = options;
  signal?.throwIfAborted();
  const bytes = plainBytes(beginning, name);
  const format = bytes.length === 0 ? undefined : findFormat(bytes, name, contentType);
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
