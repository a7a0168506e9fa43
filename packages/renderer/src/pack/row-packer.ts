/**
 * Packs splats while they arrive, in WebAssembly with SIMD. Each splat is read once and written as its words, which equal
 * those of `packGaussians`. After the last splat they are sorted, and sent in blocks.
 */
import type { GaussianCloud } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import type { RowLayout, SortedBlock } from './joined-blocks.js';
import { curveThrough, type Curve } from './morton.js';
import type { PackOptions } from './pack.js';
import { INBOX_BYTES, packerCode, PackerMemory, strideOf, type PackableRows } from './packer-memory.js';
import { choosePrecision } from './sh.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, type ShPrecision } from './words.js';

export { packerCode };

const { CULL_GROUP } = constants;

/** Number of splats that are sent together. */
const BLOCK_SPLATS = 1 << 14;
/** Number of blocks that are sent before the first is returned. */
const BLOCKS_AWAY = 8;
/** Number of splats of one call. Engines replace the first, slow code of a function only between two calls. */
const SLICE_SPLATS = 1 << 13;
/** Number of splats of a cloud that are copied at once. */
const CLOUD_SPLATS = 1 << 10;
/** Number of positions that the curve is fitted to, as in `sampleAxis`. */
const SAMPLE = 4096;

/** Packed splats of consecutive rows. */
interface Run {
  /** Row of the first splat. The others are next to it, also if rows between them were unusable. */
  readonly first: number;
  readonly count: number;
}

/** The buffers of a block, which the receiver returns for reuse. */
export type BlockBuffers = Pick<SortedBlock, 'geometry' | 'sh'>;
/** Receives a block. Resolves with its buffers when they are no longer needed; undefined if they are not returned. */
export type BlockReceiver = (block: SortedBlock) => void | Promise<BlockBuffers | undefined>;

export class RowPacker {
  readonly #rowBytes: number;
  readonly #stride: number;
  readonly #memory: PackerMemory;
  /** Packed splats, in the order of their rows. */
  #runs: Run[] = [];
  /** Bytes of an incomplete row at the beginning of the inbox. */
  #left = 0;
  /** Address of the sorted pairs of a code and an index; 0 for the order of the file. */
  #sorted = 0;
  /** Number of rows that were packed, or reserved for others. */
  #rows = 0;
  #count = 0;

  /**
   * Returns undefined if the code cannot run, or the scene is too large for it.
   * @param rows Rows of a file; the number of splats for the arrays of a cloud.
   */
  static async open(rows: PackableRows | number, layout: RowLayout): Promise<RowPacker | undefined> {
    const module = await packerCode();
    try {
      return module && new RowPacker(module, rows, layout);
    } catch (error) {
      // More memory than WebAssembly can address, or the system has.
      if (error instanceof RangeError) return undefined;
      throw error;
    }
  }

  private constructor(module: WebAssembly.Module, given: PackableRows | number, layout: RowLayout) {
    const rows = typeof given === 'number' ? undefined : given;
    this.#rowBytes = rows?.byteLength ?? 0;
    this.#stride = strideOf(layout);
    this.#memory = new PackerMemory(module, rows?.count ?? (given as number), layout, rows);
  }

  /** Number of packed splats. */
  get count(): number {
    return this.#count;
  }

  /** Number of rows that were packed, or reserved for {@link place}. */
  get rows(): number {
    return this.#rows;
  }

  /** Number of bytes that complete the row that has been pushed in part; 0 if there is none. */
  get missing(): number {
    return this.#left && this.#rowBytes - this.#left;
  }

  /** Packs the next bytes of the rows. */
  push(bytes: Uint8Array): void {
    const { inbox } = this.#memory.at;
    const memory = this.#memory.bytes(inbox, INBOX_BYTES + this.#rowBytes);
    for (let from = 0; from < bytes.length;) {
      const size = Math.min(bytes.length - from, INBOX_BYTES - this.#left);
      memory.set(bytes.subarray(from, from + size), this.#left);
      from += size;
      const there = this.#left + size;
      const rows = Math.floor(there / this.#rowBytes);
      this.#pack([inbox, inbox, inbox, inbox, inbox], rows);
      this.#left = there - rows * this.#rowBytes;
      memory.copyWithin(0, rows * this.#rowBytes, there);
    }
  }

  /** Packs a cloud, for a packer that was opened with a number of splats. */
  pushCloud({ count, positions, scales, rotations, opacities, sh }: GaussianCloud): void {
    const { inbox } = this.#memory.at;
    const tables = [positions, scales, rotations, opacities, sh].map((table) => ({
      table,
      size: table.length / count,
    }));
    for (let first = 0; first < count; first += CLOUD_SPLATS) {
      const end = Math.min(count, first + CLOUD_SPLATS);
      let next = inbox;
      const places = tables.map(({ table, size }) => {
        const part = table.subarray(size * first, size * end);
        const at = next;
        this.#memory.floats(at, part.length).set(part);
        next += 4 * part.length;
        return at;
      });
      this.#pack(places, end - first);
    }
  }

  #pack(places: readonly number[], rows: number): void {
    const { words, reaches, noises } = this.#memory.at;
    const first = this.#rows;
    const facts = [words + this.#stride * first, this.#stride, reaches + 4 * first, noises + 4 * first];
    const count = this.#memory.code.pack(...places, rows, ...facts);
    this.#rows += rows;
    this.#add({ first, count });
  }

  #add(run: Run): void {
    let at = this.#runs.length;
    while (at > 0 && this.#runs[at - 1].first > run.first) at--;
    const before = this.#runs[at - 1];
    if (before && before.first + before.count === run.first)
      this.#runs[at - 1] = { first: before.first, count: before.count + run.count };
    else this.#runs.splice(at, 0, run);
    this.#count += run.count;
  }

  /** Reserves the next rows for {@link place}, and returns the index of the first. Call between two rows. */
  reserve(rows: number): number {
    const first = this.#rows;
    this.#rows += rows;
    return first;
  }

  /** Adds the splats of reserved rows, which {@link take} of another packer has written. @param first Index of the row. */
  place(first: number, count: number, bytes: Uint8Array): void {
    const { words, reaches, noises } = this.#memory.at;
    const { memory } = this.#memory;
    let from = 0;
    const put = (at: number, size: number): void => {
      new Uint8Array(memory.buffer, at + size * first, size * count).set(bytes.subarray(from, (from += size * count)));
    };
    put(words, this.#stride);
    put(reaches, 4);
    put(noises, 4);
    this.#add({ first, count });
  }

  /**
   * Writes the packed splats for {@link place}, and forgets them. Their words take fewer bytes than their rows.
   * @returns The number of splats.
   */
  take(bytes: Uint8Array): number {
    const { words, reaches, noises } = this.#memory.at;
    let to = 0;
    const [starts, sizes] = [
      [words, reaches, noises],
      [this.#stride, 4, 4],
    ];
    starts.forEach((start, k) => {
      for (const { first, count } of this.#runs) {
        bytes.set(this.#memory.bytes(start + sizes[k] * first, sizes[k] * count), to);
        to += sizes[k] * count;
      }
    });
    const count = this.#count;
    this.#runs = [];
    this.#rows = this.#count = 0;
    return count;
  }

  /** Sorts all splats along a curve, or keeps the order of a scene of planes. Call once, after the last row. */
  sort(): void {
    const curve = this.#curve();
    const isPlain = this.#runs.length === 1 && this.#runs[0].first === 0;
    if (curve) this.#sortAlong(curve);
    else if (!isPlain) {
      this.#sorted = this.#memory.more(8 * this.#count);
      const pairs = this.#memory.words(this.#sorted, 2 * this.#count);
      let k = 0;
      for (const { first, count } of this.#runs) for (let i = first; i < first + count; i++) pairs[2 * k++ + 1] = i;
    }
  }

  #curve(): Curve | undefined {
    const count = Math.min(SAMPLE, this.#count);
    const positions = new Float32Array(3 * count);
    const rowOf = this.rowReader();
    for (let k = 0; k < count; k++) {
      const row = rowOf(Math.floor((k * this.#count) / count));
      positions.set(this.#memory.floats(this.#memory.at.words + this.#stride * row, 3), 3 * k);
    }
    return curveThrough(positions, upTo(count));
  }

  /** Radix sort with 8 bits in each pass. */
  #sortAlong(curve: Curve): void {
    const { code, at } = this.#memory;
    const axes = new Float64Array(this.#memory.memory.buffer, at.axes, 6);
    curve.forEach(({ median, spread }, axis) => ([axes[axis], axes[3 + axis]] = [median, 2 * spread]));
    this.#inSlices((first, end) => code.encode(at.words, this.#stride, first, end, at.codes, at.axes));
    const a = (this.#sorted = this.#memory.more(16 * this.#count));
    const b = a + 8 * this.#count;
    const digits = this.#memory.words(at.digits, 1024).fill(0);
    this.#inSlices((first, end) => code.count(at.codes, first, end, at.digits));
    for (let pass = 0; pass < 4; pass++) {
      for (let digit = 256 * pass, next = 0; digit < 256 * (pass + 1); digit++)
        [digits[digit], next] = [next, next + digits[digit]];
      const places = at.digits + 1024 * pass;
      const [from, to] = pass % 2 ? [b, a] : [a, b];
      if (pass === 0) this.#inSlices((first, end) => code.begin(at.codes, b, first, end, places));
      else slices(0, this.#count, (first, end) => code.move(from, to, first, end, 8 * pass, places));
    }
  }

  /** Precision of the harmonics that the scene requires: see `choosePrecision`. Call after {@link sort}. */
  precisionFor(asked: PackOptions['sh'] = 'auto'): ShPrecision {
    if (asked !== 'auto') return asked;
    const noises = this.#memory.floats(this.#memory.at.noises, this.#rows);
    const pairs = this.#sorted ? this.#memory.words(this.#sorted, 2 * this.#count) : undefined;
    return choosePrecision(pairs ? (k) => noises[pairs[2 * k + 1]] : (k) => noises[k], this.#count);
  }

  /** Returns a function that returns the index of the k-th packed splat. Call it with ascending k. */
  rowReader(): (k: number) => number {
    let [run, before] = [0, 0];
    return (k) => {
      while (k - before >= this.#runs[run].count) before += this.#runs[run++].count;
      return this.#runs[run].first + k - before;
    };
  }

  /** Words and reaches by the index of a splat. The views become invalid with the next call of another function. */
  get packed(): { readonly words: Uint32Array; readonly stride: number; readonly reaches: Float32Array } {
    const { words, reaches } = this.#memory.at;
    return {
      words: this.#memory.words(words, (this.#stride / 4) * this.#rows),
      stride: this.#stride / 4,
      reaches: this.#memory.floats(reaches, this.#rows),
    };
  }

  /**
   * Sends all splats in blocks. Waits for the receiver if it is late, and reuses the buffers that it returns. Rejects if
   * the receiver does.
   */
  async finish(send: BlockReceiver): Promise<void> {
    const { reaches, words } = this.#memory.at;
    const shBytes = this.#stride - 4 * GEOMETRY_WORDS;
    const chunkBytes = (4 * CHUNK_NUMBERS * BLOCK_SPLATS) / CULL_GROUP;
    const from = this.#memory.more(this.#stride * BLOCK_SPLATS + chunkBytes);
    const shFrom = from + 4 * GEOMETRY_WORDS * BLOCK_SPLATS;
    const chunksFrom = shFrom + shBytes * BLOCK_SPLATS;
    const away: Promise<BlockBuffers | undefined>[] = [];
    const copied = (
      at: number,
      length: number,
      room: Uint32Array<ArrayBuffer> | undefined,
    ): Uint32Array<ArrayBuffer> => {
      const copy =
        room && room.buffer.byteLength >= 4 * length
          ? new Uint32Array(room.buffer, 0, length)
          : new Uint32Array(length);
      copy.set(this.#memory.words(at, length));
      return copy;
    };
    for (let start = 0; start < this.#count; start += BLOCK_SPLATS) {
      const count = Math.min(BLOCK_SPLATS, this.#count - start);
      const room = away.length >= BLOCKS_AWAY ? await away.shift() : undefined;
      const order = [this.#sorted, start, start + count];
      this.#memory.code.gather(...order, words, this.#stride, reaches, from, shFrom, chunksFrom);
      const chunks = this.#memory.floats(chunksFrom, CHUNK_NUMBERS * Math.ceil(count / CULL_GROUP)).slice();
      const geometry = copied(from, GEOMETRY_WORDS * count, room?.geometry);
      const sent = send({ start, geometry, sh: copied(shFrom, (shBytes / 4) * count, room?.sh), chunks });
      // A rejection is thrown when the loop comes to it.
      sent?.catch(() => undefined);
      if (sent) away.push(sent);
    }
    await Promise.all(away);
  }

  #inSlices(run: (first: number, end: number) => void): void {
    for (const { first, count } of this.#runs) slices(first, first + count, run);
  }
}

function slices(from: number, to: number, run: (first: number, end: number) => void): void {
  for (let first = from; first < to; first += SLICE_SPLATS) run(first, Math.min(to, first + SLICE_SPLATS));
}

const upTo = (count: number): Uint32Array => Uint32Array.from({ length: count }, (_, k) => k);
