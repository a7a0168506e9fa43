import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import type { SplatState } from './splat-input.js';

/** Maximum number of splats in a sample. */
const MAX_SAMPLE = 1 << 14;

/**
 * Returns the number of splats from index `first` to `end` - 1 that cannot be drawn: with NaN, without a rotation, or
 * with positions or colors that are infinite. Infinite logarithms and logits are scales and opacities of 0 or 1.
 */
export function unusableRows({ arrays, raw }: SplatState, first: number, end: number): number {
  const { positions, scales, rotations, opacities, sh, colors } = arrays as Required<SplatState['arrays']>;
  const values = sh ?? colors;
  const stride = values.length / opacities.length;
  let unusable = 0;
  for (let i = first; i < end; i++) {
    const [p, q] = [3 * i, 4 * i];
    const size = scales[p] + scales[p + 1] + scales[p + 2] + opacities[i];
    let sum = positions[p] + positions[p + 1] + positions[p + 2];
    for (let k = stride * i; k < stride * (i + 1); k++) sum += values[k];
    const norm = rotations[q] ** 2 + rotations[q + 1] ** 2 + rotations[q + 2] ** 2 + rotations[q + 3] ** 2;
    const isSized = raw
      ? !Number.isNaN(size)
      : Number.isFinite(size) && Math.min(scales[p], scales[p + 1], scales[p + 2]) >= 0;
    if (!(isSized && Number.isFinite(sum) && norm > 0 && norm < Infinity)) unusable++;
  }
  return unusable;
}

/** Returns evenly spaced splats that can be drawn, with opacities 0..1, for bounds. */
export function sampleOf(state: SplatState): Pick<GaussianCloud, 'count' | 'positions' | 'opacities' | 'origin'> {
  const { arrays, raw, count: all, origin } = state;
  const { positions, opacities } = arrays as Required<SplatState['arrays']>;
  const step = Math.max(1, Math.ceil(all / MAX_SAMPLE));
  const places = new Float32Array(3 * Math.ceil(all / step));
  const visible = new Float32Array(places.length / 3);
  let count = 0;
  for (let i = 0; i < all; i += step) {
    if (unusableRows(state, i, i + 1) > 0) continue;
    places.set(positions.subarray(3 * i, 3 * i + 3), 3 * count);
    visible[count++] = raw ? 1 / (1 + Math.exp(-opacities[i])) : opacities[i];
  }
  return { count, positions: places.subarray(0, 3 * count), opacities: visible.subarray(0, count), origin };
}

/** Returns the error for a scene whose splats are all unusable. */
export const nothingToDraw = (count: number): GaussianSplatError =>
  new GaussianSplatError('argument/cloud', {
    where: 'splats',
    expected: 'a splat that can be drawn',
    found: `${count} splats with values that are not finite, or without a rotation`,
    remedy: 'check the learning rates of the training: its values may have become NaN',
  });
