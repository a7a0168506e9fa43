/** Number of splats whose nearest neighbor is searched. */
const SAMPLE = 128;
/** Number of splats before and after each of them, in the given order, among which the neighbor is searched. */
const REACH = 512;

/**
 * Returns the spacing of splats on a surface, in the unit of the positions: the median side of the cell that each splat
 * occupies. Twice the distance of nearest neighbors for randomly scattered splats. 0 if there are fewer than two
 * splats.
 * @param kept Indices of the splats, in Morton order.
 */
export function spacingOf(positions: Float32Array, kept: Uint32Array): number {
  const count = Math.min(SAMPLE, kept.length);
  const distances = Float64Array.from({ length: count }, (_, s) => {
    const k = Math.floor((s * kept.length) / count);
    let nearest = Infinity;
    for (let j = Math.max(0, k - REACH); j < Math.min(kept.length, k + REACH); j++) {
      if (j !== k) nearest = Math.min(nearest, squaredDistance(positions, 3 * kept[k], 3 * kept[j]));
    }
    return Math.sqrt(nearest);
  }).sort();
  const median = 2 * distances[count >> 1];
  return Number.isFinite(median) ? median : 0;
}

function squaredDistance(positions: Float32Array, p: number, q: number): number {
  const x = positions[p] - positions[q];
  const y = positions[p + 1] - positions[q + 1];
  const z = positions[p + 2] - positions[q + 2];
  return x * x + y * y + z * z;
}

/**
 * Error of a level as a factor of its spacing: twice the root mean square distance from a point of a surface to the
 * nearest of the scattered splats, 2 √(1/π) for cells of side 1. A splat as wide as its cell adds as much again (in
 * squares).
 */
export const CELL_ERROR = 1.6;

/**
 * Estimates the errors of the levels of a node in world units, because the file does not state them. They depend on the
 * spacing of each level and of the finest level, and increase from level to level.
 * @param spacings Spacing of each level in world units, finest first: see {@link spacingOf}.
 */
export function errorsOfSpacings(spacings: readonly number[]): number[] {
  const errors: number[] = [];
  spacings.forEach((spacing, level) => {
    const displaced = CELL_ERROR * Math.sqrt(Math.max(0, spacing ** 2 - spacings[0] ** 2));
    errors.push(level === 0 ? 0 : Math.max(displaced, 1.001 * errors[level - 1], Number.EPSILON * spacing));
  });
  return errors;
}
