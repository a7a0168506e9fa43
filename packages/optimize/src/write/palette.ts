import { RankedHeap } from '@gaussian-splat/renderer/tools';

/** Clusters of similar vectors, and the cluster of each. */
export interface Palette {
  /** [size, width] means of the clusters. */
  readonly entries: Float32Array;
  /** [N] index of the cluster of each vector. */
  readonly labels: Uint32Array;
  /** Number of clusters. */
  readonly size: number;
}

interface Group {
  readonly members: Uint32Array;
  readonly mean: Float64Array;
  /** Weighted sum of squared distances from the mean. */
  readonly error: number;
}

/** Iterations of the power method that finds the principal axis of a cluster. */
const TURNS = 3;

/**
 * Divides vectors into at most `size` clusters. Each iteration splits the cluster with the largest error at its mean,
 * perpendicular to its principal axis.
 * @param vectors [N, width]
 * @param weights [N] weight of the squared error of each vector.
 */
export function findPalette(vectors: Float32Array, width: number, weights: Float32Array, size: number): Palette {
  const count = weights.length;
  const groupOf = (members: Uint32Array): Group => {
    const mean = new Float64Array(width);
    let all = 0;
    for (const i of members) {
      all += weights[i];
      for (let k = 0; k < width; k++) mean[k] += weights[i] * vectors[width * i + k];
    }
    if (all > 0) for (let k = 0; k < width; k++) mean[k] /= all;
    let error = 0;
    for (const i of members) {
      let square = 0;
      for (let k = 0; k < width; k++) square += (vectors[width * i + k] - mean[k]) ** 2;
      error += weights[i] * square;
    }
    return { members, mean, error };
  };
  const found: Group[] = [];
  const heap = new RankedHeap(size + 1);
  const push = (members: Uint32Array): void => {
    const group = groupOf(members);
    heap.push(found.push(group) - 1, group.error);
  };
  push(Uint32Array.from({ length: count }, (_, i) => i));
  const done: Group[] = [];
  while (heap.size + done.length < size && heap.size > 0) {
    const group = found[heap.pop()];
    const parts = group.error > 0 ? cut(group, vectors, width, weights) : undefined;
    if (parts === undefined) done.push(group);
    else parts.forEach(push);
  }
  const groups = [...Array.from(heap.items, (k) => found[k]), ...done];
  const labels = new Uint32Array(count);
  const entries = new Float32Array(width * groups.length);
  groups.forEach(({ members, mean }, label) => {
    entries.set(mean, width * label);
    for (const i of members) labels[i] = label;
  });
  return { entries, labels, size: groups.length };
}

/**
 * Splits a cluster at its mean, perpendicular to its principal axis. Returns the indices of the vectors of both halves;
 * undefined if one would be empty.
 */
function cut(
  { members, mean }: Group,
  vectors: Float32Array,
  width: number,
  weights: Float32Array,
): readonly [Uint32Array, Uint32Array] | undefined {
  let axis = Float64Array.from({ length: width }, (_, k) => 1 + (k % 7) / 7);
  const along = (i: number): number => {
    let sum = 0;
    for (let k = 0; k < width; k++) sum += axis[k] * (vectors[width * i + k] - mean[k]);
    return sum;
  };
  for (let turn = 0; turn < TURNS; turn++) {
    const next = new Float64Array(width);
    for (const i of members) {
      const share = weights[i] * along(i);
      for (let k = 0; k < width; k++) next[k] += share * (vectors[width * i + k] - mean[k]);
    }
    const length = Math.hypot(...next);
    if (!(length > 0)) return undefined;
    axis = next.map((x) => x / length);
  }
  const isFirst = Uint8Array.from(members, (i) => (along(i) < 0 ? 1 : 0));
  const first = members.filter((_, k) => isFirst[k] === 1);
  if (first.length === 0 || first.length === members.length) return undefined;
  return [first, members.filter((_, k) => isFirst[k] === 0)];
}
