import { GaussianSplatError } from '@gaussian-splat/core';

/** The error for memory that could not be had; undefined for errors of other kinds. */
export function outOfMemory(error: unknown, where: string): GaussianSplatError | undefined {
  if (!(error instanceof RangeError)) return undefined;
  return new GaussianSplatError('out-of-memory/allocation', {
    where,
    expected: 'memory enough to unpack the scene',
    found: error.message,
    remedy: 'use a smaller scene, or close other pages',
    cause: error,
  });
}
