/** Number of splats whose nearest neighbor is searched. */
export const SAMPLE = 128;
/** Number of splats before and after each of them, in the given order, among which the neighbor is searched. */
export const REACH = 512;

/**
 * Returns the spacing of splats on a surface, in the unit of the positions: the median side of the cell that each splat
 * occupies. Twice the distance of nearest neighbors for randomly scattered splats. 0 if there are fewer than two
 * splats.
 * @param kept Indices of the splats, in Morton order.
 */
export const spacingOf = (positions: Float32Array, kept: Uint32Array): number =>
  spacingBetween(distancesIn(positions, kept));

/** Returns the spacing of splats whose nearest neighbors have these distances; 0 if there are none. */
export function spacingBetween(distances: Float64Array): number {
  const median = 2 * distances.sort()[distances.length >> 1];
  return Number.isFinite(median) ? median : 0;
}

/** Returns the distances of some splats from the nearest of those near them in the order. */
function distancesIn(positions: Float32Array, kept: Uint32Array): Float64Array {
  const count = Math.min(SAMPLE, kept.length);
  const ordered = new Float32Array(3 * kept.length);
  for (let k = 0; k < kept.length; k++) {
    ordered[3 * k] = positions[3 * kept[k]];
    ordered[3 * k + 1] = positions[3 * kept[k] + 1];
    ordered[3 * k + 2] = positions[3 * kept[k] + 2];
  }
  const distances = new Float64Array(count);
  for (let s = 0; s < count; s++) {
    const k = Math.floor((s * kept.length) / count);
    const before = nearestTo(ordered, 3 * k, 3 * Math.max(0, k - REACH), 3 * k);
    const after = nearestTo(ordered, 3 * k, 3 * (k + 1), 3 * Math.min(kept.length, k + REACH));
    distances[s] = Math.sqrt(Math.min(before, after));
  }
  return distances;
}

/** Returns the squared distance from the point at index `at` to the nearest of the points from index `first` to `end`. */
function nearestTo(points: Float32Array, at: number, first: number, end: number): number {
  const [px, py, pz] = [points[at], points[at + 1], points[at + 2]];
  let nearest = Infinity;
  for (let k = first; k < end; k += 3) {
    const [x, y, z] = [px - points[k], py - points[k + 1], pz - points[k + 2]];
    const distance = x * x + y * y + z * z;
    if (distance < nearest) nearest = distance;
  }
  return nearest;
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
