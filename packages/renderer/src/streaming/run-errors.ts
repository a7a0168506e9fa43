/** Splats whose nearest neighbour is looked for, and among how many before and behind them in the order. */
const SAMPLE = 128;
const REACH = 512;

/** Width of the cells that the splats of a surface have each to itself: scattered at random, twice the distance of nearest neighbours. Their median. */
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
 * Twice the root mean square of how far points of a surface are from the nearest of splats scattered over it, 2 √(1/π) for cells 1 wide, and as much again (in squares)
 * for the shape of a splat that is as wide as its cell.
 */
const CELL_ERROR = 1.6;

/**
 * How far the levels of a node displace what they show, world units: the file does not say, so it is taken from how far apart their splats are, and those of the
 * finest. Grows from level to level.
 * @param spacings of each level (see {@link spacingOf}), the finest first, world units
 */
export function errorsOfSpacings(spacings: readonly number[]): number[] {
  const errors: number[] = [];
  spacings.forEach((spacing, level) => {
    const displaced = CELL_ERROR * Math.sqrt(Math.max(0, spacing ** 2 - spacings[0] ** 2));
    errors.push(level === 0 ? 0 : Math.max(displaced, 1.001 * errors[level - 1], Number.EPSILON * spacing));
  });
  return errors;
}
