/** RAD of Spark, whose tree has splats as nodes: a node here is the descendants of neighboring splats. */
import { shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { grouped, startsWith } from '../bytes.js';
import { allocateCloud, type DraftCloud } from '../cloud.js';
import { damaged } from '../faults.js';
import { chunkIn, parseRadHead, radHeadBytes, type RadChunk } from '../rad/container.js';
import { indicesOf } from '../rad/properties.js';
import { fill, paletteIn, requireLater, requireProperty, type Palette } from '../readers/rad.js';
import type { ReadNode, SceneNode, SceneTree, TreeFiles, TreeReader } from './types.js';

interface RadFacts {
  /** [2 C] first and last byte of each chunk, excluding the latter. */
  readonly places: Float64Array;
  /** [C] files of the chunks; absent if they are in the scene's file. */
  readonly files?: readonly (string | undefined)[];
  readonly count: number;
  readonly chunkSize: number;
  readonly paletteCount: number | undefined;
}

/** Siblings whose parents are near one another, and all splats below them. */
interface RadNode extends SceneNode {
  /** [2 R] first index and number of consecutive splats of the file. */
  readonly ranges: Uint32Array;
}

/** Splats of a chunk. */
interface Decoded {
  readonly cloud: DraftCloud;
  /** Number of children of each splat, and index in the file of its first child. */
  readonly childCounts: Uint32Array;
  readonly childStarts: Uint32Array;
}

/** Splats of a page, unless a chunk contains too few levels: at least this number, or twice the splats that it begins with. */
const PAGE_SPLATS = 4096;
/** Maximum number of splats of a page. */
const MAX_PAGE_SPLATS = 1 << 16;
/** Maximum number of splats that a page replaces. */
const RUN_SPLATS = 2048;
/** Ratio of the sizes of splats that are replaced one after the other. */
const SIZE_STEP = 1.25;
const MAX_STEPS = 64;
/** Maximum number of chunks that are kept decoded. */
const MAX_DECODED = 2;

/** Returns undefined for a file without levels. */
async function open(given: Uint8Array, files: TreeFiles): Promise<SceneTree | undefined> {
  if (startsWith(given, 'RADC')) return undefined;
  const length = radHeadBytes(given);
  const bytes = given.length < length ? await files.openShared(undefined, 0, length) : given;
  const { places, count, chunkSize, paletteCount, isTree } = parseRadHead({ ...files, bytes });
  if (!isTree) return undefined;
  if (chunkSize === 0 || count === 0 || Math.ceil(count / chunkSize) !== places.length)
    throw damaged(
      `${files.name}, chunks`,
      `${grouped(count)} splats in chunks of ${chunkSize}`,
      grouped(places.length),
    );
  const facts: RadFacts = {
    places: Float64Array.from(places.flatMap(({ first, end }) => [first, end])),
    ...(places.some(({ file }) => file !== undefined) && { files: places.map(({ file }) => file) }),
    ...{ count, chunkSize, paletteCount },
  };
  const root: RadNode = { ranges: Uint32Array.of(0, 1), children: [] };
  return { container: 'rad', facts, roots: [root], isDescended: false, isComplete: false, splats: count };
}

/** The latest chunks, by their bytes, which `files` keeps for some time. */
const decoded = new Map<Uint8Array, Decoded>();
const palettes = new WeakMap<Uint8Array, Palette>();

async function decodedChunk(k: number, facts: RadFacts, files: TreeFiles): Promise<Decoded> {
  const { name, budget } = files;
  const where = `${name}, chunks[${k}]`;
  const parse = async (n: number): Promise<readonly [Uint8Array, RadChunk]> => {
    const path = facts.files?.[n];
    const [first, end] = facts.places.subarray(2 * n, 2 * n + 2);
    const bytes = await (path === undefined ? files.openShared(undefined, first, end) : files.openIndex(path));
    files.signal?.throwIfAborted();
    return [bytes, chunkIn({ budget }, bytes, `${name}, chunks[${n}]`, facts.paletteCount)];
  };
  const [bytes, chunk] = await parse(k);
  const known = decoded.get(bytes);
  if (known) return known;
  const { count, degree } = chunk;
  const expected = Math.min(facts.chunkSize, facts.count - k * facts.chunkSize);
  if (count !== expected) throw damaged(where, `${grouped(expected)} splats`, grouped(count));
  let palette: Palette = [];
  if (facts.paletteCount !== undefined) {
    // Spark's palette is in the first chunk.
    const [place, first] = k === 0 ? [bytes, chunk] : await parse(0);
    palette = palettes.get(place) ?? paletteIn([first], degree, { budget, name });
    palettes.set(place, palette);
  }
  const numbers = (property: string): Uint32Array =>
    indicesOf(requireProperty(chunk, property), count, { budget, name: where });
  const cloud = allocateCloud(count, degree as ShDegree, { budget, name: where });
  budget.take(4 * count, where);
  const rows = Uint32Array.from({ length: count }, (_, i) => i);
  fill(cloud, 0, chunk, rows, palette, { budget });
  const result = { cloud, childCounts: numbers('child_count'), childStarts: numbers('child_start') };
  decoded.set(bytes, result);
  for (const oldest of decoded.keys()) if (decoded.size > MAX_DECODED) decoded.delete(oldest);
  return result;
}

async function read({ ranges }: RadNode, facts: RadFacts, files: TreeFiles): Promise<ReadNode> {
  const { name, budget } = files;
  const { chunkSize } = facts;
  const chunks = new Map<number, Decoded>();
  const own: number[] = [];
  for (let r = 0; r < ranges.length; r += 2) {
    const [first, count] = [ranges[r], ranges[r + 1]];
    budget.take(8 * count, name);
    for (let i = first; i < first + count; i++) own.push(i);
  }
  for (const k of new Set(own.map((i) => Math.floor(i / chunkSize))))
    chunks.set(k, await decodedChunk(k, facts, files));
  const at = (i: number): readonly [Decoded, number] => [chunks.get(Math.floor(i / chunkSize))!, i % chunkSize];
  const childrenOf = (i: number): readonly [first: number, count: number] => {
    const [{ childCounts, childStarts }, row] = at(i);
    const [first, count] = [childStarts[row], childCounts[row]];
    requireLater(i, first, count, facts.count, name);
    return [first, count];
  };
  const isHere = (i: number): boolean => {
    const [first, count] = childrenOf(i);
    return count > 0 && [first, first + count - 1].every((one) => chunks.has(Math.floor(one / chunkSize)));
  };
  const sizeOf = (i: number): number => {
    const [{ cloud }, row] = at(i);
    const [x, y, z] = cloud.scales.subarray(3 * row, 3 * row + 3);
    return Math.max(x, y, z) * wider(cloud.opacities[row]);
  };
  const splats = expanded(own, { childrenOf, isHere, sizeOf });
  budget.take(64 * splats.length, name);
  const isLeaf = (i: number): boolean => childrenOf(i)[1] === 0;
  const inner = new Map<number, number[]>();
  for (const i of splats) {
    if (isLeaf(i)) continue;
    const [first, count] = childrenOf(i);
    // Siblings may begin in the chunk before, which is then present.
    const chunk = Math.floor((first + count - 1) / chunkSize);
    const list = inner.get(chunk) ?? [];
    list.push(i);
    inner.set(chunk, list);
  }
  const placeOf = (i: number): Float32Array => {
    const [{ cloud }, row] = at(i);
    return cloud.positions.subarray(3 * row, 3 * row + 3);
  };
  const runs = [...inner.values()].flatMap((list) => divided(list, placeOf));
  const order = [...runs.flat(), ...splats.filter(isLeaf)];
  const degree = Math.max(0, ...[...chunks.values()].map(({ cloud }) => cloud.shDegree)) as ShDegree;
  const cloud = allocateCloud(order.length, degree, files);
  order.forEach((i, k) => copySplat(...at(i), cloud, k));
  return {
    ...{ cloud, isAdded: false, error: Infinity, parts: runs.map(({ length }) => length) },
    found: runs.map((run): RadNode => ({ ranges: rangesOf(run.map(childrenOf)), children: [] })),
  };
}

interface Splats {
  readonly childrenOf: (i: number) => readonly [first: number, count: number];
  /** Whether a splat has children, which are in the chunks of the page. */
  readonly isHere: (i: number) => boolean;
  readonly sizeOf: (i: number) => number;
}

/** Replaces the largest splats by their children, as long as these are present and the page has few splats. */
function expanded(own: readonly number[], { childrenOf, isHere, sizeOf }: Splats): readonly number[] {
  const enough = Math.max(PAGE_SPLATS, 2 * own.length);
  let splats = own;
  for (let step = 0; step < MAX_STEPS && splats.length < enough; step++) {
    const largest = splats.reduce((max, i) => (isHere(i) ? Math.max(max, sizeOf(i)) : max), -1);
    if (largest < 0) break;
    const next: number[] = [];
    let left = splats.length;
    for (const i of splats) {
      left--;
      const [first, count] = childrenOf(i);
      const isReplaced = isHere(i) && sizeOf(i) >= largest / SIZE_STEP;
      if (!isReplaced || next.length + left + count > MAX_PAGE_SPLATS) next.push(i);
      else for (let child = first; child < first + count; child++) next.push(child);
    }
    splats = next;
  }
  return splats;
}

/** Divides splats at medians until no part has more than {@link RUN_SPLATS}. */
function divided(splats: readonly number[], placeOf: (i: number) => Float32Array): (readonly number[])[] {
  if (splats.length <= RUN_SPLATS) return [splats];
  const sides = [0, 1, 2].map((axis) => {
    const [low, high] = splats.reduce(
      ([min, max], i) => [Math.min(min, placeOf(i)[axis]), Math.max(max, placeOf(i)[axis])],
      [Infinity, -Infinity],
    );
    return high - low;
  });
  const axis = sides.indexOf(Math.max(...sides));
  const sorted = splats.toSorted((a, b) => placeOf(a)[axis] - placeOf(b)[axis]);
  const middle = sorted.length >> 1;
  return [...divided(sorted.slice(0, middle), placeOf), ...divided(sorted.slice(middle), placeOf)];
}

/** Joins ranges that follow one another. */
function rangesOf(children: readonly (readonly [first: number, count: number])[]): Uint32Array {
  const joined: [number, number][] = [];
  for (const [first, count] of children.toSorted(([a], [b]) => a - b)) {
    const last = joined.at(-1);
    if (last && last[0] + last[1] === first && last[1] + count < MAX_PAGE_SPLATS) last[1] += count;
    else joined.push([first, count]);
  }
  return Uint32Array.from(joined.flat());
}

/** Returns how much wider than its standard deviations Spark assumes a splat of this opacity to be (`lod_opacity`). */
const wider = (opacity: number): number => (opacity > 1 ? Math.sqrt(1 + Math.E * Math.log(opacity)) : 1);

/** Euler's constant. */
const GAMMA = 0.5772;

/**
 * Returns the opacity of this renderer for one of Spark above 1. Spark draws o copies of a splat of opacity 1, whose alpha
 * is 1 - (1 - g)^o. Its integral is the harmonic number of o; that of min(1, p g) is 1 + ln p.
 */
function opacityFrom(spark: number): number {
  if (spark <= 1) return spark;
  const harmonic = Math.log(spark) + GAMMA + 1 / (2 * spark) - 1 / (12 * spark ** 2);
  return Math.min(Math.E, Math.max(1, Math.exp(harmonic - 1)));
}

function copySplat({ cloud: from }: Decoded, row: number, to: DraftCloud, k: number): void {
  to.positions.set(from.positions.subarray(3 * row, 3 * row + 3), 3 * k);
  to.scales.set(from.scales.subarray(3 * row, 3 * row + 3), 3 * k);
  to.rotations.set(from.rotations.subarray(4 * row, 4 * row + 4), 4 * k);
  to.opacities[k] = opacityFrom(from.opacities[row]);
  const [own, all] = [from, to].map(({ shDegree }) => 3 * shCoefficientCount(shDegree));
  to.sh.set(from.sh.subarray(own * row, own * (row + 1)), all * k);
}

export const reader: TreeReader = {
  open,
  read: (node, facts, files) => read(node as RadNode, facts as RadFacts, files),
};
