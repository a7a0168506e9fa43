/** Maximum number of splats that estimate the typical distance between neighbors. */
const SAMPLES = 200;

/** A hash grid of points, which finds the points near a position. */
export class PlaceGrid {
  /** Side of a cell in units of the scene. Points farther away may not be found. */
  readonly cell: number;
  /** [N, 3] cell of each point, in the order of `#points`. */
  readonly #cells: Int32Array;
  readonly #mask: number;
  /** For each bucket, index in `#points` of its first point. */
  readonly #starts: Uint32Array;
  /** [N] indices of the points, sorted by bucket. */
  readonly #points: Uint32Array;

  /** Returns a grid of points, [N, 3]. @param cells Side of a cell in typical distances between neighbors. */
  static of(positions: Float32Array, count: number, cells: number): PlaceGrid {
    return new PlaceGrid(positions, count, cells * spacingOf(positions, count));
  }

  constructor(positions: Float32Array, count: number, cell: number) {
    this.cell = cell;
    const cells = new Int32Array(3 * count);
    for (let k = 0; k < 3 * count; k++) cells[k] = Math.floor(positions[k] / cell);
    const buckets = 2 ** Math.ceil(Math.log2(Math.max(2, 2 * count)));
    this.#mask = buckets - 1;
    this.#starts = new Uint32Array(buckets + 1);
    const bucketOf = new Uint32Array(count);
    for (let i = 0; i < count; i++) {
      bucketOf[i] = this.#bucket(cells[3 * i], cells[3 * i + 1], cells[3 * i + 2]);
      this.#starts[bucketOf[i] + 1]++;
    }
    for (let b = 0; b < buckets; b++) this.#starts[b + 1] += this.#starts[b];
    this.#points = new Uint32Array(count);
    const next = this.#starts.slice();
    this.#cells = new Int32Array(3 * count);
    for (let i = 0; i < count; i++) {
      const place = next[bucketOf[i]]++;
      this.#points[place] = i;
      for (let axis = 0; axis < 3; axis++) this.#cells[3 * place + axis] = cells[3 * i + axis];
    }
  }

  /**
   * Calls `isEnough` with each point in the 27 cells around row `i` of `positions`, until a call returns true. Points in
   * the central cell come first.
   */
  forEachNear(positions: Float32Array, i: number, isEnough: (point: number) => boolean): void {
    const x = Math.floor(positions[3 * i] / this.cell);
    const y = Math.floor(positions[3 * i + 1] / this.cell);
    const z = Math.floor(positions[3 * i + 2] / this.cell);
    if (this.#isEnoughIn(x, y, z, isEnough)) return;
    for (let dx = -1; dx <= 1; dx++)
      for (let dy = -1; dy <= 1; dy++)
        for (let dz = -1; dz <= 1; dz++) {
          const isOwn = dx === 0 && dy === 0 && dz === 0;
          if (!isOwn && this.#isEnoughIn(x + dx, y + dy, z + dz, isEnough)) return;
        }
  }

  #isEnoughIn(x: number, y: number, z: number, isEnough: (point: number) => boolean): boolean {
    const cells = this.#cells;
    const bucket = this.#bucket(x, y, z);
    for (let k = this.#starts[bucket]; k < this.#starts[bucket + 1]; k++) {
      const isHere = cells[3 * k] === x && cells[3 * k + 1] === y && cells[3 * k + 2] === z;
      if (isHere && isEnough(this.#points[k])) return true;
    }
    return false;
  }

  #bucket(x: number, y: number, z: number): number {
    return (Math.imul(x, 73_856_093) ^ Math.imul(y, 19_349_663) ^ Math.imul(z, 83_492_791)) & this.#mask;
  }
}

/**
 * Returns the typical distance between neighbors: the median, over a sample, of the distance to the nearest other point.
 * 1 for fewer than two points.
 */
function spacingOf(positions: Float32Array, count: number): number {
  if (count < 2) return 1;
  const order = Uint32Array.from({ length: count }, (_, i) => i);
  const spread = [0, 1, 2].map((axis) => {
    let [low, high] = [Infinity, -Infinity];
    for (let i = 0; i < count; i++) {
      low = Math.min(low, positions[3 * i + axis]);
      high = Math.max(high, positions[3 * i + axis]);
    }
    return high - low;
  });
  const axis = spread.indexOf(Math.max(...spread));
  order.sort((a, b) => positions[3 * a + axis] - positions[3 * b + axis]);
  const distances = Float64Array.from({ length: Math.min(SAMPLES, count) }, (_, k) =>
    nearest(positions, order, Math.floor((k * count) / Math.min(SAMPLES, count)), axis),
  ).sort();
  return Math.max(distances[distances.length >> 1], 1e-6 * (spread[axis] || 1));
}

/**
 * Returns the distance to the nearest other point, by a sweep along an axis in both directions.
 * @param order Indices of all points, sorted along the axis.
 * @param place Index in `order` of the point.
 */
function nearest(positions: Float32Array, order: Uint32Array, place: number, axis: number): number {
  const own = order[place];
  let min = Infinity;
  for (const step of [-1, 1]) {
    for (let k = place + step; k >= 0 && k < order.length; k += step) {
      const other = order[k];
      if (Math.abs(positions[3 * other + axis] - positions[3 * own + axis]) >= min) break;
      const distance = Math.hypot(...[0, 1, 2].map((each) => positions[3 * other + each] - positions[3 * own + each]));
      min = Math.min(min, distance);
    }
  }
  return min;
}
