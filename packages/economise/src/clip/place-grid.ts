/** Splats that the distance between neighbours is estimated from. */
const SAMPLES = 200;

/** Points by the cell of a grid that they are in: those near a place are found without a look at the others. */
export class PlaceGrid {
  /** Side of a cell, world units: what is farther away than that may not be found. */
  readonly cell: number;
  readonly #positions: Float32Array;
  readonly #mask: number;
  /** Where the points of each bucket begin. */
  readonly #starts: Uint32Array;
  readonly #points: Uint32Array;

  /** @param cells side of a cell, in typical distances between neighbours */
  static of(positions: Float32Array, count: number, cells: number): PlaceGrid {
    return new PlaceGrid(positions, count, cells * spacingOf(positions, count));
  }

  constructor(positions: Float32Array, count: number, cell: number) {
    this.cell = cell;
    this.#positions = positions;
    const buckets = 2 ** Math.ceil(Math.log2(Math.max(2, 2 * count)));
    this.#mask = buckets - 1;
    this.#starts = new Uint32Array(buckets + 1);
    const bucketOf = new Uint32Array(count);
    for (let i = 0; i < count; i++) {
      bucketOf[i] = this.#bucket(this.#at(positions, i, 0), this.#at(positions, i, 1), this.#at(positions, i, 2));
      this.#starts[bucketOf[i] + 1]++;
    }
    for (let b = 0; b < buckets; b++) this.#starts[b + 1] += this.#starts[b];
    this.#points = new Uint32Array(count);
    const next = this.#starts.slice();
    for (let i = 0; i < count; i++) this.#points[next[bucketOf[i]]++] = i;
  }

  /** Calls with each point in the 27 cells around point `i` of other positions, and perhaps with some that are farther away. */
  forEachNear(positions: Float32Array, i: number, visit: (point: number) => void): void {
    const [x, y, z] = [this.#at(positions, i, 0), this.#at(positions, i, 1), this.#at(positions, i, 2)];
    for (let dx = -1; dx <= 1; dx++) {
      for (let dy = -1; dy <= 1; dy++) {
        for (let dz = -1; dz <= 1; dz++) {
          const bucket = this.#bucket(x + dx, y + dy, z + dz);
          for (let k = this.#starts[bucket]; k < this.#starts[bucket + 1]; k++) {
            const point = this.#points[k];
            // Cells that share a bucket are visited once each.
            if (
              this.#at(this.#positions, point, 0) === x + dx &&
              this.#at(this.#positions, point, 1) === y + dy &&
              this.#at(this.#positions, point, 2) === z + dz
            )
              visit(point);
          }
        }
      }
    }
  }

  #at(positions: Float32Array, i: number, axis: number): number {
    return Math.floor(positions[3 * i + axis] / this.cell);
  }

  #bucket(x: number, y: number, z: number): number {
    return (Math.imul(x, 73_856_093) ^ Math.imul(y, 19_349_663) ^ Math.imul(z, 83_492_791)) & this.#mask;
  }
}

/** Median distance of a splat to its nearest neighbour, from a sample: of all others, along the axis that spreads farthest. */
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

/** Distance to the nearest other point, by a sweep along an axis in both directions. */
function nearest(positions: Float32Array, order: Uint32Array, place: number, axis: number): number {
  const own = order[place];
  let least = Infinity;
  for (const step of [-1, 1]) {
    for (let k = place + step; k >= 0 && k < order.length; k += step) {
      const other = order[k];
      if (Math.abs(positions[3 * other + axis] - positions[3 * own + axis]) >= least) break;
      const distance = Math.hypot(...[0, 1, 2].map((each) => positions[3 * other + each] - positions[3 * own + each]));
      least = Math.min(least, distance);
    }
  }
  return least;
}
