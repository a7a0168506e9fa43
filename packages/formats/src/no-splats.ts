import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from './bytes.js';

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
