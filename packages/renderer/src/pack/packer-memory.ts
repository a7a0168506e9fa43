/** The WebAssembly that packs splats, and its memory. packages/renderer/assembly/pack-rows.ts is the code. */
import { shCoefficientCount } from '@gaussian-splat/core';
import { rowsWasm } from '../generated/pack-rows.js';
import { constants } from '../generated/shaders.js';
import type { RowLayout } from './joined-blocks.js';
import { CODE_NOISE, MAX_BITS, PER_UNIT } from './sh.js';
import { GEOMETRY_WORDS, shWords } from './words.js';

/** Splats in rows of float32 numbers. */
export interface PackableRows {
  /** Maximum number of rows. */
  readonly count: number;
  readonly byteLength: number;
  /** Byte offsets in a row, as `splatRanges` returns them. */
  readonly columns: readonly number[];
}

/** Functions of the code, whose comments describe their arguments. */
export interface PackerCode {
  setup(...numbers: number[]): void;
  pack(...numbers: number[]): number;
  encode(words: number, stride: number, first: number, end: number, codes: number, axes: number): void;
  count(keys: number, first: number, end: number, tables: number): void;
  begin(keys: number, to: number, first: number, end: number, places: number): void;
  move(from: number, to: number, first: number, end: number, shift: number, places: number): void;
  gather(...numbers: number[]): void;
}

/** Bytes that are copied to WebAssembly at once: they stay in the cache until they are packed. */
export const INBOX_BYTES = 1 << 18;
const PAGE = 65_536;
/** Bytes of memory besides that of splats. */
const OTHER_BYTES = 2 ** 20;
const MAX_BYTES = 2 ** 32 - PAGE;
/** Bytes of a splat besides its words: its reach, its noise, its code, and two pairs of a code and an index. */
const FACT_BYTES = 28;

let compiled: Promise<WebAssembly.Module | undefined> | undefined;

/**
 * Compiles the code, once for the thread. Resolves with undefined if the browser lacks SIMD, or the policy of the page
 * forbids WebAssembly.
 */
export const packerCode = (): Promise<WebAssembly.Module | undefined> =>
  (compiled ??= WebAssembly.compile(rowsWasm()).catch(() => undefined));

/** Bytes of the words of a splat. */
export const strideOf = ({ shDegree, shPrecision }: Pick<RowLayout, 'shDegree' | 'shPrecision'>): number =>
  4 * (GEOMETRY_WORDS + shWords(shDegree, shPrecision));

/** Columns of a cloud, whose five arrays are the tables. */
function columnsOfCloud({ shDegree }: RowLayout): number[] {
  const terms = shCoefficientCount(shDegree) - 1;
  const rest = [0, 1, 2].flatMap((channel) =>
    Array.from({ length: 15 }, (_, k) => (k < terms ? 12 * (k + 1) + 4 * channel : 0)),
  );
  return [0, 4, 8, 0, 4, 8, 0, 4, 8, 12, 0, 0, 4, 8, ...rest];
}

/** Addresses of the parts of the memory. */
type Places = Readonly<Record<'axes' | 'digits' | 'inbox' | 'codes' | 'noises' | 'reaches' | 'words', number>>;

export class PackerMemory {
  readonly memory: WebAssembly.Memory;
  readonly code: PackerCode;
  readonly at: Places;
  #end = 1024;

  /** @param rows Rows of a file; undefined for the arrays of a cloud of `count` splats. */
  constructor(module: WebAssembly.Module, count: number, layout: RowLayout, rows: PackableRows | undefined) {
    const { shDegree, shPrecision, moved } = layout;
    const stride = strideOf(layout);
    if (count * (stride + FACT_BYTES) + OTHER_BYTES > MAX_BYTES) throw new RangeError('more than WebAssembly holds');
    const take = (bytes: number): number => this.#take(bytes);
    const [steps, offsets, numbers, tables, scratch] = [take(20), take(4 * 64), take(24), take(5 * 1024), take(192)];
    this.at = {
      axes: take(48),
      digits: take(4096),
      inbox: take(INBOX_BYTES + (rows?.byteLength ?? 0) + 16),
      codes: take(4 * count),
      noises: take(4 * count),
      reaches: take(4 * count),
      words: take(stride * count + 16),
    };
    this.memory = new WebAssembly.Memory({ initial: Math.ceil(this.#end / PAGE) });
    this.code = new WebAssembly.Instance(module, { env: { memory: this.memory } }).exports as unknown as PackerCode;
    const { buffer } = this.memory;
    const sh = 12 * shCoefficientCount(shDegree);
    new Uint32Array(buffer, steps, 5).set(rows ? Array<number>(5).fill(rows.byteLength) : [12, 12, 16, 4, sh]);
    new Uint32Array(buffer, offsets, 59).set(rows?.columns ?? columnsOfCloud(layout));
    new Float64Array(buffer, numbers, 3).set(moved);
    new Float64Array(buffer, tables, 512).set([...CODE_NOISE, ...PER_UNIT]);
    new Int32Array(buffer, tables + 4096, 256).set(MAX_BITS);
    const visible = Math.ceil(new Uint32Array(Float32Array.of(constants.ALPHA_MIN).buffer)[0] / 16);
    const flags = [shPrecision === 'float16', moved.some((x) => x !== 0), rows === undefined].map(Number);
    this.code.setup(steps, offsets, shDegree, ...flags, numbers, tables, scratch, visible);
  }

  #take(bytes: number): number {
    const at = this.#end;
    this.#end = Math.ceil((at + bytes) / 16) * 16;
    return at;
  }

  /** Reserves more memory, and returns its address. Earlier views of the memory become invalid. */
  more(bytes: number): number {
    const at = this.#take(bytes);
    this.memory.grow(Math.max(0, Math.ceil((this.#end - this.memory.buffer.byteLength) / PAGE)));
    return at;
  }

  bytes(at: number, length: number): Uint8Array<ArrayBuffer> {
    return new Uint8Array(this.memory.buffer as ArrayBuffer, at, length);
  }

  floats(at: number, length: number): Float32Array<ArrayBuffer> {
    return new Float32Array(this.memory.buffer as ArrayBuffer, at, length);
  }

  words(at: number, length: number): Uint32Array<ArrayBuffer> {
    return new Uint32Array(this.memory.buffer as ArrayBuffer, at, length);
  }
}
