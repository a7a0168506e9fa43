/** Errors of whole scenes, of any format. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from './bytes.js';

/** The error for a file without a byte. */
export function emptyFile(name: string): GaussianSplatError {
  return new GaussianSplatError('decode/empty', {
    where: `${name}, byte 0`,
    expected: 'a scene file',
    found: '0 bytes',
    remedy: 'check the address of the scene and the upload; the file is empty',
  });
}

/** The error for a scene of which nothing can be drawn. */
export function noSplats(name: string, droppedCount: number): GaussianSplatError {
  return new GaussianSplatError('decode/empty', {
    where: name,
    expected: '1 splat or more that can be drawn',
    found:
      droppedCount === 0
        ? '0 splats'
        : `${grouped(droppedCount)} splats, all with values that cannot be drawn (not finite, no rotation or no extent)`,
    remedy: 'export the scene again; this file has nothing to show',
  });
}

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
