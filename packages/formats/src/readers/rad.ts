import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { allocateCloud, SH_C0, type DraftCloud } from '../cloud.js';
import { damaged } from '../faults.js';
import { chunksOf, type RadChunk, type RadProperty } from '../rad/container.js';
import { contentOf, indicesOf, valuesOf } from '../rad/properties.js';
import type { SceneSource } from '../scene-format.js';

/** Count of a splat's coefficients in each band above the constant one, and index of the band's first coefficient. */
const BANDS = [
  { size: 9, first: 3 },
  { size: 15, first: 12 },
  { size: 21, first: 27 },
] as const;

/**
 * Reads Spark's RAD (`rad.rs` of spark-lib, version 1). Chunks of splats are in the file or in separate files. Properties
 * are deflated columns with different encodings, and spherical harmonics may be in a palette. Only the leaves of a tree
 * of levels are read, which are the original splats; if these are more than `source.maxSplats`, the finest cut through
 * the tree that has fewer.
 */
export async function readRad(source: SceneSource): Promise<GaussianCloud> {
  const { maxSplats = Infinity } = source;
  const chunks: RadChunk[] = [];
  let rows: Uint32Array[] = [];
  let degree = 0;
  for await (const chunk of chunksOf(source)) {
    source.signal?.throwIfAborted();
    chunks.push(chunk);
    rows.push(leavesOf(chunk, source));
    degree = Math.max(degree, chunk.degree);
  }
  const countOf = (): number => rows.reduce((sum, { length }) => sum + length, 0);
  if (countOf() > maxSplats && chunks.every((chunk) => find(chunk, 'child_start')))
    rows = cutOf(chunks, maxSplats, source);
  const count = countOf();
  const cloud = allocateCloud(count, degree as ShDegree, source);
  const palette = paletteIn(chunks, degree, source);
  let at = 0;
  for (const [k, chunk] of chunks.entries()) {
    source.signal?.throwIfAborted();
    fill(cloud, at, chunk, rows[k], palette, source);
    at += rows[k].length;
  }
  return cloud;
}

/**
 * Returns the indices in each chunk of the splats of a cut through the tree, which replaces the largest splats first.
 * @param max Maximum number of splats.
 */
function cutOf(chunks: readonly RadChunk[], max: number, { budget }: SceneSource): Uint32Array[] {
  const total = chunks.reduce((sum, { count }) => sum + count, 0);
  const [counts, starts] = [new Uint32Array(total), new Uint32Array(total)];
  const sizes = new Float32Array(total);
  let at = 0;
  for (const chunk of chunks) {
    const { count, where: name } = chunk;
    budget.take(17 * count, name);
    const read = (key: string): Uint32Array => indicesOf(find(chunk, key)!, count, { budget, name });
    counts.set(read('child_count'), at);
    starts.set(read('child_start'), at);
    const scales = valuesOf(requireProperty(chunk, 'scales'), 3, count, { budget, name });
    for (let i = 0; i < count; i++) sizes[at + i] = Math.max(...scales.subarray(3 * i, 3 * i + 3));
    at += count;
  }
  for (let i = 0; i < total; i++) {
    requireLater(i, starts[i], counts[i], total, chunks[0].where);
    for (let child = starts[i]; child < starts[i] + counts[i]; child++) sizes[child] = Math.min(sizes[child], sizes[i]);
  }
  const inner = Uint32Array.from({ length: total }, (_, i) => i).filter((i) => counts[i] > 0);
  // The sort is stable, so that parents precede children of the same size.
  inner.sort((a, b) => sizes[b] - sizes[a] || a - b);
  const isShown = new Uint8Array(total);
  isShown[0] = 1;
  let shown = 1;
  for (const i of inner) {
    if (isShown[i] === 0) continue;
    shown += counts[i] - 1;
    if (shown > max) break;
    isShown[i] = 0;
    isShown.fill(1, starts[i], starts[i] + counts[i]);
  }
  at = 0;
  return chunks.map(({ count }) => {
    const first = at;
    at += count;
    return Uint32Array.from({ length: count }, (_, i) => i).filter((i) => isShown[first + i] === 1);
  });
}

/** Throws unless the children of splat `i` are after it, so that the tree has no loops. @param total Number of splats. */
export function requireLater(i: number, first: number, count: number, total: number, where: string): void {
  if (count === 0 || (first > i && first + count <= total)) return;
  const expected = `an index from ${grouped(i + 1)} to ${grouped(total - count)}`;
  throw damaged(`${where}, child_start`, expected, grouped(first));
}

/** Returns the indices of a chunk's splats without children. */
function leavesOf(chunk: RadChunk, { budget }: SceneSource): Uint32Array {
  const children = chunk.isTree ? find(chunk, 'child_count') : undefined;
  // The count of a chunk is not checked against its bytes yet, so that it is charged to the budget.
  budget.take(8 * chunk.count, chunk.where);
  const counts = children && valuesOf(children, 1, chunk.count, { budget, name: chunk.where });
  const leaves = new Uint32Array(chunk.count);
  let kept = 0;
  for (let i = 0; i < chunk.count; i++) if (!counts?.[i]) leaves[kept++] = i;
  return leaves.slice(0, kept);
}

const find = ({ properties }: RadChunk, name: string): RadProperty | undefined =>
  properties.find((property) => property.name === name);

/** Returns a property. Throws `decode/header` without it. */
export function requireProperty(chunk: RadChunk, name: string): RadProperty {
  const property = find(chunk, name);
  if (!property) throw damaged(chunk.where, `the property ${name}`, 'none', 'decode/header');
  return property;
}

/** Palette of spherical harmonics: for each band, [entries, size]. Labels of splats are indices of entries. */
export type Palette = readonly (Float32Array | undefined)[];

/** Returns the palette of a file, which one of its chunks contains, usually the first. Bands without one are undefined. */
export function paletteIn(
  chunks: readonly RadChunk[],
  degree: number,
  { budget, name }: Pick<SceneSource, 'budget' | 'name'>,
): Palette {
  return BANDS.slice(0, degree).map(({ size }, band) => {
    for (const chunk of chunks) {
      const codes = find(chunk, `sh${band + 1}_code`);
      if (codes) return valuesOf(codes, size, chunk.paletteCount, { budget, name: `${name}, palette` });
    }
  });
}

/** Writes splats of a chunk to a cloud, from splat `at` on. @param rows Indices of the splats in the chunk. */
export function fill(
  cloud: DraftCloud,
  at: number,
  chunk: RadChunk,
  rows: Uint32Array,
  palette: Palette,
  { budget }: Pick<SceneSource, 'budget'>,
): void {
  const { where } = chunk;
  const read = (name: string, size: number): Float32Array =>
    valuesOf(requireProperty(chunk, name), size, chunk.count, { budget, name: where });
  /** Copies the rows of `from`, [splats, size], to rows of `stride` numbers, from the column `offset` on. */
  const copy = (from: Float32Array, size: number, to: Float32Array, stride: number, offset = 0): void => {
    for (let k = 0; k < rows.length; k++)
      for (let n = 0; n < size; n++) to[stride * (at + k) + offset + n] = from[size * rows[k] + n];
  };
  copy(read('center', 3), 3, cloud.positions, 3);
  copy(read('scales', 3), 3, cloud.scales, 3);
  copy(read('alpha', 1), 1, cloud.opacities, 1);
  copy(quaternionsOf(chunk, budget), 4, cloud.rotations, 4);
  const stride = 3 * shCoefficientCount(cloud.shDegree);
  copy(
    read('rgb', 3).map((value) => (value - 0.5) / SH_C0),
    3,
    cloud.sh,
    stride,
  );
  const labels = find(chunk, 'sh_label') && palette.some(Boolean) ? read('sh_label', 1) : undefined;
  BANDS.slice(0, chunk.degree).forEach(({ size, first }, band) => {
    const codes = palette[band];
    if (!labels || !codes) return copy(read(`sh${band + 1}`, size), size, cloud.sh, stride, first);
    const entries = codes.length / size;
    for (let k = 0; k < rows.length; k++) {
      const entry = labels[rows[k]];
      if (entry >= entries) throw damaged(`${where}, sh_label`, `labels below ${grouped(entries)}`, grouped(entry));
      for (let n = 0; n < size; n++) cloud.sh[stride * (at + k) + first + n] = codes[size * entry + n];
    }
  });
}

/** Decodes quaternions (w, x, y, z), [N, 4], from an octahedral axis and an angle in bytes, or from (x, y, z). */
function quaternionsOf(chunk: RadChunk, budget: SceneSource['budget']): Float32Array {
  const { where, count } = chunk;
  const property = requireProperty(chunk, 'orientation');
  budget.take(16 * count, where);
  const quaternions = new Float32Array(4 * count);
  if (property.encoding === 'oct88r8') {
    const codes = contentOf(property, 3 * count, `${where}, orientation`, budget);
    for (let i = 0; i < count; i++) unfold(codes, 3 * i, quaternions, 4 * i);
    return quaternions;
  }
  const vectors = valuesOf(property, 3, count, { budget, name: where });
  for (let i = 0; i < count; i++) {
    const [x, y, z] = vectors.subarray(3 * i, 3 * i + 3);
    quaternions.set([Math.sqrt(Math.max(0, 1 - x * x - y * y - z * z)), x, y, z], 4 * i);
  }
  return quaternions;
}

/** Decodes a quaternion from an octahedral axis of 2 bytes (Meyer et al. 2010), and an angle in 255ths of π radians. */
function unfold(codes: Uint8Array, from: number, quaternions: Float32Array, to: number): void {
  const [u, v] = [(2 * codes[from]) / 255 - 1, (2 * codes[from + 1]) / 255 - 1];
  const z = 1 - Math.abs(u) - Math.abs(v);
  const fold = Math.max(0, -z);
  const x = u >= 0 ? u - fold : u + fold;
  const y = v >= 0 ? v - fold : v + fold;
  const half = (codes[from + 2] / 255) * (Math.PI / 2);
  const share = Math.sin(half) / Math.hypot(x, y, z);
  quaternions.set([Math.cos(half), share * x, share * y, share * z], to);
}
