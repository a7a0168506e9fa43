import type { CloudHints } from '@gaussian-splat/core';

export type OrbitLimits = NonNullable<CloudHints['orbit']>;

/**
 * Converts the safe orbit of Adobe, in an SPZ or PLY, to limits of polar angles from up. Zeros, its defaults, are no
 * limits.
 *
 * @param values Smallest and largest elevation above the horizon in -π/2..π/2, radians, and smallest distance to the
 *   target in world units.
 * @returns undefined for values outside of these ranges.
 */
export function safeOrbit([lowest, highest, minRadius]: readonly number[]): OrbitLimits | undefined {
  const hasAngles = lowest !== 0 || highest !== 0;
  const isValid = lowest >= -QUARTER && highest <= QUARTER && minRadius >= 0 && minRadius < Infinity;
  if (!isValid || (hasAngles && !(lowest < highest))) return undefined;
  return {
    ...(hasAngles && { minPhi: Math.max(0, Math.PI / 2 - highest), maxPhi: Math.min(Math.PI, Math.PI / 2 - lowest) }),
    ...(minRadius > 0 && { minRadius }),
  };
}

/** A right angle, with the rounding of float32. */
const QUARTER = Math.PI / 2 + 1e-6;
