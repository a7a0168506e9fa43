/**
 * Number of splats whose nearest neighbor is searched, and the number of splats before and after them in the order to
 * search.
 */
const SAMPLE = 128;
const REACH = 512;

/**
 * Side of the cell that each splat of a surface occupies on median: twice the distance of nearest neighbors for
 * randomly scattered splats.
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
 * Twice the root mean square distance between points of a surface and the nearest splat scattered over it, 2 √(1/π) for
 * cells of side 1, and as much again (in squares) for a splat as wide as its cell.
 */
const CELL_ERROR = 1.6;

/**
 * Estimates the errors of the levels of a node in world units from the spacing of their splats and of the finest,
 * because the file does not state them. They increase from level to level.
 * @param spacings Of each level (see {@link spacingOf}), finest first, world units.
 */
export function errorsOfSpacings(spacings: readonly number[]): number[] {
  const errors: number[] = [];
  spacings.forEach((spacing, level) => {
    const displaced = CELL_ERROR * Math.sqrt(Math.max(0, spacing ** 2 - spacings[0] ** 2));
    errors.push(level === 0 ? 0 : Math.max(displaced, 1.001 * errors[level - 1], Number.EPSILON * spacing));
  });
  return errors;
}
