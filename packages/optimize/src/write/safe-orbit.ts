import type { GaussianCloud } from '@gaussian-splat/core';

/**
 * Returns the safe orbit of Adobe for the limits of a scene: smallest and largest elevation above the horizon, radians,
 * and smallest distance to the target in world units. Undefined if a scene has no limits.
 */
export function safeOrbitOf({ hints }: Pick<GaussianCloud, 'hints'>): readonly [number, number, number] | undefined {
  if (!hints?.orbit) return undefined;
  const { minPhi, maxPhi, minRadius = 0 } = hints.orbit;
  // Two zeros are no limits.
  if (minPhi === undefined && maxPhi === undefined) return [0, 0, minRadius];
  return [Math.PI / 2 - (maxPhi ?? Math.PI), Math.PI / 2 - (minPhi ?? 0), minRadius];
}
