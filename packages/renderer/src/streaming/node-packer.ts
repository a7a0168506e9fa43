/** Packs nodes of trees in WebAssembly. packages/renderer/assembly/pack-nodes.ts is the code. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { nodesWasm } from '../generated/pack-nodes.js';
import { constants } from '../generated/shaders.js';
import { chunksOf } from '../levels/splat-level.js';
import { curveThrough } from '../pack/morton.js';
import { MAX_BITS, PER_UNIT } from '../pack/sh.js';
import { CHUNK_NUMBERS } from '../pack/words.js';
import { pageLayout, type PageFormat } from './manifest.js';
import type { RunWords } from './pack-run.js';
import { CENTER_STEPS, FARTHER, MAX_OCTAVES } from './quantized-geometry.js';
import { REACH, SAMPLE } from './run-errors.js';

/** Functions of the code, whose comments describe their arguments. */
interface Code {
  setup(...numbers: number[]): void;
  divide(...numbers: number[]): void;
  order(...numbers: number[]): void;
  spacings(...numbers: number[]): void;
  pack(...numbers: number[]): void;
}

const { ALPHA_MIN, QUANTIZED_OPAQUE, QUANTIZED_SIZES, QUANTIZED_T_ZERO, QUANTIZED_UV_ZERO } = constants;
const NUMBERS = [
  ...[ALPHA_MIN, Math.ceil(ALPHA_MIN * QUANTIZED_OPAQUE), QUANTIZED_OPAQUE, QUANTIZED_SIZES],
  ...[QUANTIZED_T_ZERO, QUANTIZED_UV_ZERO, MAX_OCTAVES, CENTER_STEPS, FARTHER],
];
const PAGE = 65_536;
const [ADDRESSES, CONSTANTS, SCRATCH, BEGIN] = [1024, 2048, 8192, 24_576];
/** Maximum number of splats of a cloud, because the memory never shrinks. They take 80 MB at degree 3. */
export const MAX_SPLATS = 250_000;
/** Numbers of a box: center, three unit vectors, three half lengths. */
export const BOX_NUMBERS = 15;

let opening: Promise<NodePacker | undefined> | undefined;

/** The code and its memory, which keeps the arrays of one cloud at a time. */
export class NodePacker {
  readonly #memory = new WebAssembly.Memory({ initial: 1 });
  readonly #code: Code;
  #end = BEGIN;
  /** End of the arrays of the cloud. */
  #base = BEGIN;

  /** Starts the code once for the thread. Resolves with undefined without SIMD, or if the page's policy forbids it. */
  static open(): Promise<NodePacker | undefined> {
    opening ??= WebAssembly.compile(nodesWasm()).then(
      (module) => new NodePacker(module),
      () => undefined,
    );
    return opening;
  }

  private constructor(module: WebAssembly.Module) {
    const { exports } = new WebAssembly.Instance(module, { env: { memory: this.#memory } });
    this.#code = exports as unknown as Code;
    const { buffer } = this.#memory;
    new Float64Array(buffer, CONSTANTS, NUMBERS.length).set(NUMBERS);
    new Float64Array(buffer, CONSTANTS + 128, 256).set(PER_UNIT);
    new Int32Array(buffer, CONSTANTS + 128 + 2048, 256).set(MAX_BITS);
  }

  /** Copies the arrays of a cloud, whose splats the other functions then use. */
  load({ positions, scales, rotations, opacities, sh, shDegree }: GaussianCloud, { shPrecision }: PageFormat): void {
    this.#end = BEGIN;
    const at = [positions, scales, rotations, opacities, sh].map((values) => this.#put(values));
    this.#base = this.#end;
    new Uint32Array(this.#memory.buffer, ADDRESSES, 5).set(at);
    this.#code.setup(ADDRESSES, shDegree, Number(shPrecision === 'float16'), CONSTANTS, SCRATCH);
  }

  /**
   * Returns the number of the nearest box of each splat, or of the first that contains it.
   * @param boxes [N, 15] see {@link BOX_NUMBERS}. @param ids Numbers of the N boxes. @param counts Zeros, to which the
   * number of splats of each box is added.
   */
  divide(own: Uint32Array, boxes: Float64Array, ids: Uint32Array, counts: Uint32Array): Uint32Array {
    this.#end = this.#base;
    const to = this.#take(4 * own.length);
    const [splats, places, names, sums] = [own, boxes, ids, counts].map((values) => this.#put(values));
    this.#code.divide(splats, own.length, places, names, ids.length, sums, to);
    counts.set(this.#words(sums, counts.length));
    return this.#words(to, own.length);
  }

  /** Sorts splats in place as `mortonOrder` does. */
  order({ positions }: GaussianCloud, own: Uint32Array): void {
    const curve = curveThrough(positions, own);
    if (!curve) return;
    this.#end = this.#base;
    const axes = this.#put(Float64Array.from([...curve.map((a) => a.median), ...curve.map((a) => 2 * a.spread)]));
    const splats = this.#put(own);
    this.#code.order(splats, own.length, axes, this.#take(20 * own.length + 4096));
    own.set(this.#words(splats, own.length));
  }

  /** Returns the distances of some splats from the nearest of those near them, as `spacingOf` does. */
  spacings(own: Uint32Array): Float64Array {
    this.#end = this.#base;
    const samples = Math.min(SAMPLE, own.length);
    const to = this.#take(8 * samples);
    const splats = this.#put(own);
    this.#code.spacings(splats, own.length, samples, REACH, to, this.#take(12 * own.length + 16));
    return new Float64Array(this.#memory.buffer, to, samples).slice();
  }

  /** Packs splats as `packRun` does. */
  pack(own: Uint32Array, shDegree: GaussianCloud['shDegree'], { shPrecision }: PageFormat): RunWords {
    this.#end = this.#base;
    const layout = pageLayout({ shDegree, shPrecision, geometry: 'quantized' }, chunksOf(own.length));
    const [geometry, sh, chunks] = [layout.geometry, layout.sh, layout.chunks].map((words) => this.#take(4 * words));
    const shBytes = (4 * layout.sh) / (constants.CULL_GROUP * (layout.chunks / CHUNK_NUMBERS) || 1);
    const splats = this.#put(own);
    new Uint8Array(this.#memory.buffer, geometry, chunks - geometry).fill(0);
    this.#code.pack(splats, own.length, geometry, sh, shBytes, chunks);
    return {
      geometry: this.#words(geometry, layout.geometry).slice(),
      sh: this.#words(sh, layout.sh).slice(),
      chunks: new Float32Array(this.#memory.buffer, chunks, layout.chunks).slice(),
    };
  }

  #words(at: number, length: number): Uint32Array {
    return new Uint32Array(this.#memory.buffer, at, length);
  }

  #put(values: Float32Array | Float64Array | Uint32Array): number {
    const at = this.#take(values.byteLength);
    const from = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
    new Uint8Array(this.#memory.buffer, at, values.byteLength).set(from);
    return at;
  }

  #take(bytes: number): number {
    const at = this.#end;
    this.#end = Math.ceil((at + bytes) / 16) * 16;
    const missing = this.#end + 16 - this.#memory.buffer.byteLength;
    if (missing > 0) this.#memory.grow(Math.ceil(missing / PAGE));
    return at;
  }
}
