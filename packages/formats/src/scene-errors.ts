/** Errors of whole scenes, independent of the format. */
import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { grouped } from './bytes.js';

/** Returns the error for a file of 0 bytes. */
export function emptyFile(name: string): GaussianSplatError {
  return new GaussianSplatError('decode/empty', {
    where: `${name}, byte 0`,
    expected: 'a scene file',
    found: '0 bytes',
    remedy: 'check the address of the scene and the upload; the file is empty',
  });
}

/** Descriptions of the reasons that {@link GaussianCloud.faults} counts, in the same order. */
const FAULTS = ['a scale below 0', 'no rotation', 'no extent', 'values that are not finite or too large'];

/** Formats {@link GaussianCloud.faults} for messages, for example `1,000 with no extent`. */
export const reasonsOf = (faults: readonly number[]): string =>
  FAULTS.flatMap((fault, k) => (faults[k] > 0 ? [`${grouped(faults[k])} with ${fault}`] : [])).join(', ');

/** Returns the error for a scene without drawable splats. */
export function noSplats(
  name: string,
  { droppedCount, faults = [] }: Pick<GaussianCloud, 'droppedCount' | 'faults'>,
): GaussianSplatError {
  return new GaussianSplatError('decode/empty', {
    where: name,
    expected: '1 splat or more that can be drawn',
    found:
      droppedCount === 0 ? '0 splats' : `${grouped(droppedCount)} splats that cannot be drawn: ${reasonsOf(faults)}`,
    remedy:
      faults[0] > 0
        ? 'export the scene again with scales that are 0 or more, not their logarithms'
        : 'export the scene again; this file has nothing to show',
  });
}

/** Converts the RangeError of a failed allocation to `out-of-memory/allocation`. Returns undefined for other errors. */
export function outOfMemory(error: unknown, where: string): GaussianSplatError | undefined {
  if (!(error instanceof RangeError)) return undefined;
  return new GaussianSplatError('out-of-memory/allocation', {
    where,
    expected: 'enough memory to unpack the scene',
    found: error.message,
    remedy: 'use a smaller scene, or close other pages',
    cause: error,
  });
}
