/** Approximate maximum number of points in a leaf. */
const LEAF = 12;

/** Count of numbers of a box: minimum x, y, z and maximum x, y, z. */
const BOX = 6;

/** A k-d tree of points, in arrays that threads can access. */
export interface PointTree {
  /** [N, 3] positions of all points. */
  readonly positions: Float32Array;
  /** Indices of the points in the tree. Those of a leaf are adjacent. */
  readonly order: Uint32Array;
  /** [nodes, BOX] bounds of the nodes. The root is node 0; the children of node n are 2n + 1 and 2n + 2. */
  readonly boxes: Float32Array;
}

/**
 * Builds a tree of points.
 * @param positions [N, 3] positions of all points.
 * @param points Indices of the points that the tree contains.
 * @param allocate Allocates the memory of `order` and `boxes`.
 */
export function treeOf(
  positions: Float32Array,
  points: Uint32Array,
  allocate: (byteLength: number) => ArrayBufferLike,
): PointTree {
  const order = new Uint32Array(allocate(4 * points.length), 0, points.length);
  order.set(points);
  const depth = Math.max(0, Math.ceil(Math.log2(points.length / LEAF)));
  const numbers = BOX * (2 ** (depth + 1) - 1);
  const tree = { positions, order, boxes: new Float32Array(allocate(4 * numbers), 0, numbers) };
  putBox(tree, 0, 0, order.length);
  return tree;
}

/**
 * Finds the nearest neighbors of points in a tree.
 * @param points Indices of the points whose neighbors are searched.
 * @param max Number of neighbors of each point.
 * @returns [points, max] indices of the neighbors, nearest first; -1 if there are fewer.
 */
export function nearestNeighbors(tree: PointTree, points: Uint32Array, max: number): Int32Array {
  const found = new Int32Array(max * points.length).fill(-1);
  const distances = new Float64Array(max);
  for (let k = 0; k < points.length; k++) {
    distances.fill(Infinity);
    search(tree, 0, 0, tree.order.length, points[k], distances, found.subarray(max * k, max * (k + 1)));
  }
  return found;
}

/**
 * Computes the box of a node with the points `first` to `end` of the order. Splits the points at the median of its longest
 * side, and does the same for both children.
 */
function putBox(tree: PointTree, node: number, first: number, end: number): void {
  const { positions, order, boxes } = tree;
  const at = BOX * node;
  for (let axis = 0; axis < 3; axis++) {
    let [min, max] = [Infinity, -Infinity];
    for (let k = first; k < end; k++) {
      const value = positions[3 * order[k] + axis];
      if (value < min) min = value;
      if (value > max) max = value;
    }
    boxes[at + axis] = min;
    boxes[at + 3 + axis] = max;
  }
  if (end - first <= LEAF) return;
  const sides = [0, 1, 2].map((axis) => boxes[at + 3 + axis] - boxes[at + axis]);
  const middle = (first + end) >> 1;
  halve(positions, order, first, end, sides.indexOf(Math.max(...sides)));
  putBox(tree, 2 * node + 1, first, middle);
  putBox(tree, 2 * node + 2, middle, end);
}

/**
 * Reorders the points `first` to `end` so that points with smaller coordinates on an axis are before the middle, and
 * larger ones after it (Hoare's selection, 1961).
 */
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

/**
 * Searches a subtree for points that are nearer than those found before.
 * @param node Index of the node, whose points are those from `first` to `end` of the order.
 * @param point Index of the point whose neighbors are searched.
 * @param distances Squared distances of the points in `found`, ascending.
 * @param found Indices of the nearest points.
 */
function search(
  tree: PointTree,
  node: number,
  first: number,
  end: number,
  point: number,
  distances: Float64Array,
  found: Int32Array,
): void {
  const last = distances.length - 1;
  if (distanceTo(tree, node, point) >= distances[last]) return;
  const { positions, order } = tree;
  if (end - first > LEAF) {
    const middle = (first + end) >> 1;
    const [a, b] = [2 * node + 1, 2 * node + 2];
    const isFirst = distanceTo(tree, a, point) <= distanceTo(tree, b, point);
    if (isFirst) search(tree, a, first, middle, point, distances, found);
    search(tree, b, middle, end, point, distances, found);
    if (!isFirst) search(tree, a, first, middle, point, distances, found);
    return;
  }
  for (let k = first; k < end; k++) {
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

/** Returns the squared distance of a point to the box of a node; 0 within the box. */
function distanceTo({ positions, boxes }: PointTree, node: number, point: number): number {
  let sum = 0;
  for (let axis = 0; axis < 3; axis++) {
    const value = positions[3 * point + axis];
    const [low, high] = [boxes[BOX * node + axis], boxes[BOX * node + 3 + axis]];
    const outside = value < low ? low - value : value > high ? value - high : 0;
    sum += outside * outside;
  }
  return sum;
}
