/**
 * Packs a scene on several threads. Each thread packs shards, which are ranges of rows, while other rows are in
 * transit. As shards arrive, their splats are distributed to cells along the Z-order curve. Several threads then sort
 * the cells, which are the blocks of the scene.
 */
import {
  boundsOf,
  MAX_POSITION,
  type Bounds,
  type GaussianCloud,
  type ShDegree,
  type Vector3,
} from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { reachOf } from './chunks.js';
import { codesAlong, curveThrough, isOfPlanes, type Curve } from './morton.js';
import { packGeometry, usableIndices, type PackedGaussians, type PackedHead, type PackOptions } from './pack.js';
import { recentered } from './recenter.js';
import { sortByKey } from './radix-sort.js';
import { BAND_SIZES, CODE_NOISE, noiseIn, packSh, PART, precisionFor, SCALE_BYTES } from './sh.js';
import { unpackSplat } from './unpack.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, type ShPrecision, shWords } from './words.js';

const { CULL_GROUP } = constants;

/** Maximum number of splats in a shard. */
export const SHARD_SPLATS = 1 << 14;
/** Number of the highest bits of a code along the curve that identify a cell. */
const CELL_BITS = 9;
const CELLS = 1 << CELL_BITS;
/** Number of the highest bits that the splats of a block for the noise statistics have in common. */
const PART_BITS = 18;
/**
 * Number of words of a splat besides its geometry and its harmonics: its reach, its noise (see `choosePrecision`), and
 * its code along the curve.
 */
const FACT_WORDS = 3;

/** Properties that all shards of a scene share. */
export interface ShareLayout {
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  /** Translation that is subtracted from the positions of the cloud, world units: see `recentered`. */
  readonly moved: Vector3;
  /** Curve along which splats are sorted; undefined for a scene that keeps the order of its file. */
  readonly curve: Curve | undefined;
}

/** Packed splats; the words of each splat are contiguous. The buffers are transferable. */
export interface PackedShard {
  readonly count: number;
  readonly words: Uint32Array<ArrayBuffer>;
  /**
   * [CELLS] index after the last splat of each cell; splats are in the order of their cells. Empty for a scene that
   * keeps its order.
   */
  readonly ends: Uint32Array<ArrayBuffer>;
}

/** The splats of a cell in the order of the file, to be sorted. The buffers are transferable. */
export interface ShareBlock {
  readonly layout: ShareLayout;
  /** Index in the scene of the first splat. */
  readonly start: number;
  readonly count: number;
  readonly words: Uint32Array<ArrayBuffer>;
}

/** A block of splats in their final order. The buffers are transferable. */
export interface SortedBlock {
  /** Index in the scene of the first splat. */
  readonly start: number;
  readonly geometry: Uint32Array<ArrayBuffer>;
  readonly sh: Uint32Array<ArrayBuffer>;
  /** Bounds of the chunks. The first and the last chunk may also contain splats of other blocks. */
  readonly chunks: Float32Array<ArrayBuffer>;
}

/** Properties of a scene that are not stored with its splats. */
export type ShardInfo = Pick<PackedGaussians, 'antialiased' | 'filterVariance' | 'origin' | 'droppedCount'>;

/** Derives the layout of a scene from a sample of its splats. */
export function layoutOf(cloud: GaussianCloud, shPrecision: ShPrecision): ShareLayout {
  const near = recentered(cloud);
  const moved = near.origin.map((x, axis) => x - cloud.origin[axis]) as unknown as Vector3;
  return { shDegree: cloud.shDegree, shPrecision, moved, curve: curveThrough(near.positions, usableIndices(near)) };
}

const wordsOf = ({ shDegree, shPrecision }: ShareLayout): number =>
  GEOMETRY_WORDS + shWords(shDegree, shPrecision) + FACT_WORDS;

/** Packs at most {@link SHARD_SPLATS} splats of a cloud; unusable ones are dropped. */
export function packShard(given: GaussianCloud, layout: ShareLayout): PackedShard {
  const { moved, curve, shPrecision, shDegree } = layout;
  const isMoved = moved.some((x) => x !== 0);
  const cloud = isMoved ? { ...given, positions: given.positions.map((x, i) => x - moved[i % 3]) } : given;
  const usable = usableIndices(cloud);
  const kept = isMoved ? withinReach(cloud.positions, usable) : usable;
  const codes = curve && codesAlong(curve, cloud.positions, kept);
  const places = codes && sortByKey(upTo(kept.length), codes.map(cellOf), CELL_BITS);
  const order = places ? places.map((place) => kept[place]) : kept;
  const codeOf = places?.map((place) => codes![place]);
  const stride = wordsOf(layout);
  const words = new Uint32Array(stride * kept.length);
  const floats = new Float32Array(words.buffer);
  const bytes = new Uint8Array(words.buffer);
  packGeometry(cloud, order, stride, words);
  packSh(cloud, order, shPrecision, stride, words, GEOMETRY_WORDS);
  const noiseOf = noiseIn(cloud);
  for (let k = 0, at = stride - FACT_WORDS; k < order.length; k++, at += stride) {
    floats[at] = reachOf(cloud, order[k]);
    const sh = 4 * (stride * k + GEOMETRY_WORDS);
    floats[at + 1] = shPrecision === 'int8' ? noiseOfPacked(bytes, sh, shDegree) : noiseOf(order[k]);
    words[at + 2] = codeOf?.[k] ?? 0;
  }
  return { count: order.length, words, ends: endsOf(codeOf) };
}

/** Returns the noise of {@link noiseIn} from harmonics that {@link packSh} has written as `int8`, at byte `at`. */
function noiseOfPacked(bytes: Uint8Array, at: number, shDegree: ShDegree): number {
  let noise = 0;
  for (let band = 0; band < shDegree; band++) noise += BAND_SIZES[band] * CODE_NOISE[bytes[at + SCALE_BYTES[band]]];
  return noise;
}

const cellOf = (code: number): number => code >>> (32 - CELL_BITS);

/** Returns the index after the last splat of each cell. @param codes Codes in the order of their cells. */
function endsOf(codes: Uint32Array | undefined): Uint32Array<ArrayBuffer> {
  const ends = new Uint32Array(codes ? CELLS : 0);
  if (codes === undefined) return ends;
  for (const code of codes) ends[cellOf(code)]++;
  for (let cell = 1; cell < CELLS; cell++) ends[cell] += ends[cell - 1];
  return ends;
}

/** Returns the indices of the splats within `MAX_POSITION`: a change of origin may move a splat out of this range. */
function withinReach(positions: Float32Array, kept: Uint32Array): Uint32Array {
  const isNear = (x: number): boolean => Math.abs(x) <= MAX_POSITION;
  return kept.filter((i) => isNear(positions[3 * i]) && isNear(positions[3 * i + 1]) && isNear(positions[3 * i + 2]));
}

/**
 * A cell, whose splats are in several shards. The block is assembled on demand, because shards are added during a
 * download.
 */
export interface ShareCell {
  readonly start: number;
  readonly count: number;
  /** Copies the splats into one block, which uses the memory `room` if that is large enough. */
  readonly block: (room?: ArrayBuffer) => ShareBlock;
}

/** The splats of a scene, distributed to cells. */
export class ShareCells {
  readonly #layout: ShareLayout;
  readonly #shares: PackedShard[] = [];
  /** Number of splats of all shards. */
  #count = 0;
  /** Sum of the noise of each block for the statistics. */
  readonly #noises = new Float64Array(1 << PART_BITS);
  /** Number of splats of each block for the statistics. */
  readonly #counts = new Uint32Array(1 << PART_BITS);

  constructor(layout: ShareLayout) {
    this.#layout = layout;
  }

  /**
   * Adds the next shard. Shards must be added in the order of the file, because splats with equal codes keep this
   * order.
   */
  add(share: PackedShard): void {
    this.#shares.push(share);
    const stride = wordsOf(this.#layout);
    const floats = new Float32Array(share.words.buffer);
    for (let at = stride - 1; at < share.words.length; at += stride) {
      const part = this.#layout.curve ? share.words[at] >>> (32 - PART_BITS) : (this.#count / PART) % (1 << PART_BITS);
      this.#noises[part | 0] += floats[at - 1];
      this.#counts[part | 0]++;
      this.#count++;
    }
  }

  /**
   * Returns the layout that the scene requires, after all of its shards were added. If it differs from the current
   * layout, the shards must be packed again.
   * @param asked Requested precision of spherical harmonics.
   */
  layoutFor(asked: PackOptions['sh'] = 'auto'): ShareLayout {
    const layout = this.#layout;
    const shPrecision = asked === 'auto' ? this.#precision() : asked;
    if (shPrecision !== layout.shPrecision) return { ...layout, shPrecision };
    return layout.curve && isOfPlanes(this.#somePositions()) ? { ...layout, curve: undefined } : layout;
  }

  /** Returns the precision as `choosePrecision` does, for blocks of at least {@link PART} splats. */
  #precision(): ShPrecision {
    let [sum, worst, noise, count] = [0, 0, 0, 0];
    this.#noises.forEach((more, part) => {
      sum += more;
      noise += more;
      count += this.#counts[part];
      if (count < PART) return;
      worst = Math.max(worst, noise / count);
      noise = count = 0;
    });
    return precisionFor(sum / Math.max(1, this.#count), Math.max(worst, count > PART / 2 ? noise / count : 0));
  }

  #somePositions(): Float32Array {
    const stride = wordsOf(this.#layout);
    const step = Math.max(1, Math.floor(this.#count / SAMPLE));
    const positions: number[] = [];
    for (const { words, count } of this.#shares) {
      const floats = new Float32Array(words.buffer);
      for (let i = 0; i < count; i += step) positions.push(...floats.subarray(stride * i, stride * i + 3));
    }
    return Float32Array.from(positions);
  }

  /** Returns the non-empty cells in the order of the scene. */
  all(): ShareCell[] {
    const cells: ShareCell[] = [];
    let start = 0;
    for (let cell = 0; cell < (this.#layout.curve ? CELLS : this.#shares.length); cell++) {
      const ranges = this.#rangesOf(cell);
      const count = ranges.reduce((sum, { first, end }) => sum + end - first, 0);
      if (count > 0) cells.push(this.#cell(start, count, ranges));
      start += count;
    }
    return cells;
  }

  #rangesOf(cell: number): Range[] {
    if (this.#layout.curve === undefined)
      return [{ share: this.#shares[cell], first: 0, end: this.#shares[cell].count }];
    return this.#shares.map((share) => ({ share, first: share.ends[cell - 1] ?? 0, end: share.ends[cell] }));
  }

  #cell(start: number, count: number, ranges: readonly Range[]): ShareCell {
    const layout = this.#layout;
    const stride = wordsOf(layout);
    const block = (room = new ArrayBuffer(0)): ShareBlock => {
      const bytes = 4 * stride * count;
      const words = new Uint32Array(room.byteLength < bytes ? new ArrayBuffer(bytes) : room, 0, stride * count);
      let at = 0;
      for (const { share, first, end } of ranges) {
        words.set(share.words.subarray(stride * first, stride * end), at);
        at += stride * (end - first);
      }
      return { layout, start, count, words };
    };
    return { start, count, block };
  }
}

/** Splats `first` to `end` of a shard. */
interface Range {
  readonly share: PackedShard;
  readonly first: number;
  readonly end: number;
}

/** Sorts the splats of a block by their codes, and computes the bounds of its chunks. */
export function sortBlock({ layout, start, count, words }: ShareBlock): SortedBlock {
  const [stride, shStride] = [wordsOf(layout), shWords(layout.shDegree, layout.shPrecision)];
  const floats = new Float32Array(words.buffer, words.byteOffset, words.length);
  const geometry = new Uint32Array(GEOMETRY_WORDS * count);
  const sh = new Uint32Array(shStride * count);
  const firstChunk = Math.floor(start / CULL_GROUP);
  const chunks = emptyChunks(Math.ceil((start + count) / CULL_GROUP) - firstChunk);
  const order = layout.curve ? orderOf(words, stride, count) : undefined;
  for (let k = 0; k < count; k++) {
    const from = stride * (order ? order[k] : k);
    for (let w = 0; w < GEOMETRY_WORDS; w++) geometry[GEOMETRY_WORDS * k + w] = words[from + w];
    for (let w = 0; w < shStride; w++) sh[shStride * k + w] = words[from + GEOMETRY_WORDS + w];
    grow(
      chunks,
      CHUNK_NUMBERS * (Math.floor((start + k) / CULL_GROUP) - firstChunk),
      floats,
      from,
      floats[from + stride - 3],
    );
  }
  return { start, geometry, sh, chunks };
}

/** Returns the indices of splats in the order of their codes; the code is the last word of a splat. */
function orderOf(words: Uint32Array, stride: number, count: number): Uint32Array {
  const codes = new Uint32Array(count);
  for (let k = 0; k < count; k++) codes[k] = words[stride * (k + 1) - 1];
  return sortByKey(upTo(count), codes);
}

const upTo = (count: number): Uint32Array => {
  const all = new Uint32Array(count);
  for (let i = 0; i < count; i++) all[i] = i;
  return all;
};

function emptyChunks(count: number): Float32Array<ArrayBuffer> {
  const chunks = new Float32Array(CHUNK_NUMBERS * count);
  for (let at = 0; at < chunks.length; at += CHUNK_NUMBERS)
    for (let axis = 0; axis < 3; axis++) [chunks[at + axis], chunks[at + 4 + axis]] = [Infinity, -Infinity];
  return chunks;
}

/** Extends the bounds of a chunk at index `at` by a splat: see `boundChunks`. */
function grow(chunks: Float32Array, at: number, floats: Float32Array, from: number, reach: number): void {
  for (let axis = 0; axis < 3; axis++) {
    const x = floats[from + axis];
    if (x < chunks[at + axis]) chunks[at + axis] = x;
    if (x > chunks[at + 4 + axis]) chunks[at + 4 + axis] = x;
  }
  if (reach > chunks[at + 3]) chunks[at + 3] = reach;
}

/** Joins the sorted blocks of a scene, which arrive in any order. */
export class JoinedBlocks {
  /** Properties of the scene that are known before its blocks arrive. */
  readonly head: PackedHead;
  /** Bounds of all chunks; complete when all blocks have arrived. */
  readonly chunks: Float32Array<ArrayBuffer>;
  readonly #send: ((block: SortedBlock) => void) | undefined;
  readonly #geometry: Uint32Array;
  readonly #sh: Uint32Array;
  readonly #step: number;
  /** Geometry of every {@link #step}-th splat, for the bounds of the scene. */
  readonly #sample: Uint32Array;

  /**
   * @param count Number of splats of all blocks.
   * @param send Receives each block when it arrives; without this function the words of all blocks are joined.
   */
  constructor(layout: ShareLayout, count: number, facts: ShardInfo, send?: (block: SortedBlock) => void) {
    const { shDegree, shPrecision, moved } = layout;
    const origin = facts.origin.map((x, axis) => x + moved[axis]) as unknown as Vector3;
    this.head = { count, shDegree, shPrecision, ...facts, origin };
    this.chunks = emptyChunks(Math.ceil(count / CULL_GROUP));
    this.#send = send;
    const kept = send ? 0 : count;
    this.#geometry = new Uint32Array(GEOMETRY_WORDS * kept);
    this.#sh = new Uint32Array(shWords(shDegree, shPrecision) * kept);
    this.#step = Math.max(1, Math.floor(count / SAMPLE));
    this.#sample = new Uint32Array(GEOMETRY_WORDS * Math.ceil(count / this.#step));
  }

  add(block: SortedBlock): void {
    const { start, geometry, sh, chunks } = block;
    const first = CHUNK_NUMBERS * Math.floor(start / CULL_GROUP);
    for (let at = 0; at < chunks.length; at += CHUNK_NUMBERS) {
      grow(this.chunks, first + at, chunks, at, chunks[at + 3]);
      grow(this.chunks, first + at, chunks, at + 4, 0);
    }
    const [step, end] = [this.#step, start + geometry.length / GEOMETRY_WORDS];
    for (let k = Math.ceil(start / step); k * step < end; k++) {
      const from = GEOMETRY_WORDS * (k * step - start);
      this.#sample.set(geometry.subarray(from, from + GEOMETRY_WORDS), GEOMETRY_WORDS * k);
    }
    if (this.#send) return this.#send(block);
    this.#geometry.set(geometry, GEOMETRY_WORDS * start);
    this.#sh.set(sh, shWords(this.head.shDegree, this.head.shPrecision) * start);
  }

  /**
   * The scene with all blocks; byte for byte the result of `packGaussians` if the layout is that of the whole scene.
   */
  get packed(): PackedGaussians {
    return { ...this.head, geometry: this.#geometry, sh: this.#sh, chunks: this.chunks };
  }

  /**
   * Bounds of the scene in world coordinates. Its box is exact; the other values are those of a sample of its splats.
   */
  get bounds(): Bounds {
    const { origin } = this.head;
    const edge = (first: number, farther: (a: number, b: number) => number): Vector3 => {
      const corner = [first, first, first];
      for (let at = 0; at < this.chunks.length; at += CHUNK_NUMBERS)
        for (let axis = 0; axis < 3; axis++)
          corner[axis] = farther(corner[axis], this.chunks[at + axis + (first > 0 ? 0 : 4)]);
      return corner.map((x, axis) => x + origin[axis]) as unknown as Vector3;
    };
    const sample = boundsOf({ ...unpacked(this.#sample), origin });
    return { ...sample, min: edge(Infinity, Math.min), max: edge(-Infinity, Math.max) };
  }
}

/** Maximum number of splats whose positions represent those of all splats. */
const SAMPLE = 65_536;

/** Returns the positions and opacities of packed splats. @param geometry [N, GEOMETRY_WORDS] */
function unpacked(geometry: Uint32Array): Pick<GaussianCloud, 'count' | 'positions' | 'opacities'> {
  const count = geometry.length / GEOMETRY_WORDS;
  const positions = new Float32Array(3 * count);
  const factors = new Float32Array(6 * count);
  const opacities = new Float32Array(count);
  for (let k = 0; k < count; k++) unpackSplat(geometry, k, positions, factors, opacities);
  return { count, positions, opacities };
}
