/** Points of a leaf, which are compared one by one. */
const LEAF = 12;

/** A part of a k-d tree: the points from `first` to `end` of its order, and their bounds. */
interface Box {
  readonly first: number;
  readonly end: number;
  readonly low: readonly number[];
  readonly high: readonly number[];
  readonly halves?: readonly [Box, Box];
}

/**
 * The nearest neighbours of points among one another.
 * @param positions [N, 3]
 * @param points numbers of those that count
 * @param most neighbours of a point
 * @returns [points, most] numbers of the neighbours, the nearest first; -1 where there are fewer
 */
export function nearestNeighbours(positions: Float32Array, points: Uint32Array, most: number): Int32Array {
  const order = points.slice();
  const tree = boxOf(positions, order, 0, order.length);
  const found = new Int32Array(most * points.length).fill(-1);
  const distances = new Float64Array(most);
  for (let k = 0; k < points.length; k++) {
    distances.fill(Infinity);
    search(positions, order, tree, points[k], distances, found.subarray(most * k, most * (k + 1)));
  }
  return found;
}

/** Puts points in the order of a k-d tree: those of each box are halved along its longest side. */
function boxOf(positions: Float32Array, order: Uint32Array, first: number, end: number): Box {
  const [low, high] = [0, 1, 2].reduce<[number[], number[]]>(
    ([lows, highs], axis) => {
      let [least, most] = [Infinity, -Infinity];
      for (let k = first; k < end; k++) {
        const value = positions[3 * order[k] + axis];
        if (value < least) least = value;
        if (value > most) most = value;
      }
      return [
        [...lows, least],
        [...highs, most],
      ];
    },
    [[], []],
  );
  if (end - first <= LEAF) return { first, end, low, high };
  const sides = high.map((value, axis) => value - low[axis]);
  const middle = (first + end) >> 1;
  halve(positions, order, first, end, sides.indexOf(Math.max(...sides)));
  const halves = [boxOf(positions, order, first, middle), boxOf(positions, order, middle, end)] as const;
  return { first, end, low, high, halves };
}

/** Hoare's selection (1961): what is less than the middle one comes before it, what is larger after it. */
function halve(positions: Float32Array, order: Uint32Array, first: number, end: number, axis: number): void {
  const middle = (first + end) >> 1;
  let [low, high] = [first, end - 1];
  while (low < high) {
    const pivot = positions[3 * order[(low + high) >> 1] + axis];
    let [i, j] = [low, high];
    while (i <= j) {
      while (positions[3 * order[i] + axis] < pivot) i++;
      while (positions[3 * order[j] + axis] > pivot) j--;
      if (i > j) break;
      [order[i], order[j]] = [order[j], order[i]];
      i++;
      j--;
    }
    if (middle <= j) high = j;
    else if (middle >= i) low = i;
    else return;
  }
}

/** Looks for what is nearer than what was found. @param distances squared, ascending, of what is in `found` */
function search(
  positions: Float32Array,
  order: Uint32Array,
  box: Box,
  point: number,
  distances: Float64Array,
  found: Int32Array,
): void {
  const last = distances.length - 1;
  if (distanceTo(box, positions, point) >= distances[last]) return;
  if (box.halves) {
    const [a, b] = box.halves;
    const isFirst = distanceTo(a, positions, point) <= distanceTo(b, positions, point);
    search(positions, order, isFirst ? a : b, point, distances, found);
    search(positions, order, isFirst ? b : a, point, distances, found);
    return;
  }
  for (let k = box.first; k < box.end; k++) {
    const other = order[k];
    if (other === point) continue;
    const dx = positions[3 * other] - positions[3 * point];
    const dy = positions[3 * other + 1] - positions[3 * point + 1];
    const dz = positions[3 * other + 2] - positions[3 * point + 2];
    const distance = dx * dx + dy * dy + dz * dz;
    if (distance >= distances[last]) continue;
    let at = last;
    for (; at > 0 && distances[at - 1] > distance; at--) {
      distances[at] = distances[at - 1];
      found[at] = found[at - 1];
    }
    distances[at] = distance;
    found[at] = other;
  }
}

/** Squared distance of a point to a box. */
function distanceTo({ low, high }: Box, positions: Float32Array, point: number): number {
  let sum = 0;
  for (let axis = 0; axis < 3; axis++) {
    const value = positions[3 * point + axis];
    const outside = value < low[axis] ? low[axis] - value : value > high[axis] ? value - high[axis] : 0;
    sum += outside * outside;
  }
  return sum;
}
