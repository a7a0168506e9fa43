import { numberToHalf } from '@gaussian-splat/core';

/** Largest finite float16. */
const HALF_MAX = 65504;

/**
 * Returns the bits of the float16 nearest to a finite number, ties to even. Magnitudes above HALF_MAX become
 * ±HALF_MAX.
 */
export const halfBits = (value: number): number => numberToHalf(Math.min(HALF_MAX, Math.max(-HALF_MAX, value)));
