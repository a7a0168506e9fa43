/** Joins the blocks of a scene, and finds its bounds. */
import { boundsOf, type Bounds, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import { innerViewFrom, type SplatSample } from '@gaussian-splat/core/views';
import { constants } from '../generated/shaders.js';
import type { PackedGaussians, PackedHead } from './pack.js';
import type { BlockReceiver } from './row-packer.js';
import { unpackSplat } from './unpack.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, type ShPrecision, shWords } from './words.js';

const { CULL_GROUP } = constants;

/** Properties that all rows of a scene share. */
export interface RowLayout {
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  /** Translation that is subtracted from the positions of the cloud, world units: see `recentered`. */
  readonly moved: Vector3;
}

/** A block of splats in their final order. The buffers are transferable, and may be longer than the arrays. */
export interface SortedBlock {
  /** Index in the scene of the first splat; a multiple of 256. */
  readonly start: number;
  readonly geometry: Uint32Array<ArrayBuffer>;
  readonly sh: Uint32Array<ArrayBuffer>;
  /** Bounds of the chunks: see `boundChunks`. */
  readonly chunks: Float32Array<ArrayBuffer>;
}

/** Properties of a scene that are not stored with its splats. */
type SceneFacts = Pick<PackedGaussians, 'antialiased' | 'filterVariance' | 'origin' | 'droppedCount'>;

export class JoinedBlocks {
  /** Properties of the scene that are known before its blocks arrive. */
  readonly head: PackedHead;
  /** Bounds of all chunks; complete when all blocks have arrived. */
  readonly chunks: Float32Array<ArrayBuffer>;
  readonly #send: BlockReceiver | undefined;
  readonly #geometry: Uint32Array;
  readonly #sh: Uint32Array;
  readonly #step: number;
  /** Geometry of every {@link #step}-th splat, for the bounds of the scene. */
  readonly #sample: Uint32Array;

  /**
   * @param count Number of splats of all blocks.
   * @param send Receives each block when it arrives; without this function the words of all blocks are joined.
   */
  constructor(layout: RowLayout, count: number, facts: SceneFacts, send?: BlockReceiver) {
    const { shDegree, shPrecision, moved } = layout;
    const origin = facts.origin.map((x, axis) => x + moved[axis]) as unknown as Vector3;
    this.head = { count, shDegree, shPrecision, ...facts, origin };
    this.chunks = new Float32Array(CHUNK_NUMBERS * Math.ceil(count / CULL_GROUP));
    this.#send = send;
    const kept = send ? 0 : count;
    this.#geometry = new Uint32Array(GEOMETRY_WORDS * kept);
    this.#sh = new Uint32Array(shWords(shDegree, shPrecision) * kept);
    this.#step = Math.max(1, Math.floor(count / SAMPLE));
    this.#sample = new Uint32Array(GEOMETRY_WORDS * Math.ceil(count / this.#step));
  }

  add(block: SortedBlock): ReturnType<BlockReceiver> {
    const { start, geometry, sh, chunks } = block;
    this.chunks.set(chunks, (CHUNK_NUMBERS * start) / CULL_GROUP);
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
   * Returns the bounds of the scene in world coordinates. Its box is exact; the other values are those of a sample of
   * its splats. @param up Unit vector; default: -y.
   */
  boundsFor(up?: Vector3): Bounds {
    const { origin } = this.head;
    const edge = (first: number, farther: (a: number, b: number) => number): Vector3 => {
      const corner = [first, first, first];
      for (let at = 0; at < this.chunks.length; at += CHUNK_NUMBERS)
        for (let axis = 0; axis < 3; axis++)
          corner[axis] = farther(corner[axis], this.chunks[at + axis + (first > 0 ? 0 : 4)]);
      return corner.map((x, axis) => x + origin[axis]) as unknown as Vector3;
    };
    const sample = boundsFrom(this.#sample, origin, this.head.count, up);
    return { ...sample, min: edge(Infinity, Math.min), max: edge(-Infinity, Math.max) };
  }
}

/** Returns the bounds of packed splats, from every `step`-th. @param geometry [N, GEOMETRY_WORDS] */
export function boundsOfPacked(geometry: Uint32Array, origin: Vector3, step: number, up?: Vector3): Bounds {
  const count = geometry.length / GEOMETRY_WORDS;
  const some = new Uint32Array(GEOMETRY_WORDS * Math.ceil(count / step));
  for (let at = 0; at < some.length; at += GEOMETRY_WORDS)
    some.set(geometry.subarray(step * at, step * at + GEOMETRY_WORDS), at);
  return boundsFrom(some, origin, count, up);
}

/** Returns the bounds of a scene from some of its `total` splats. @param geometry [N, GEOMETRY_WORDS] */
function boundsFrom(geometry: Uint32Array, origin: Vector3, total: number, up?: Vector3): Bounds {
  const sample = { ...unpacked(geometry), origin };
  const bounds = boundsOf(sample);
  return { ...bounds, inside: innerViewFrom(sample, bounds, total, up) };
}

/** Maximum number of splats whose positions represent those of all splats. */
const SAMPLE = 16_384;

/** Returns packed splats as a sample. @param geometry [N, GEOMETRY_WORDS] */
function unpacked(geometry: Uint32Array): Omit<SplatSample, 'origin'> {
  const count = geometry.length / GEOMETRY_WORDS;
  const positions = new Float32Array(3 * count);
  const factors = new Float32Array(6 * count);
  const opacities = new Float32Array(count);
  const axes = new Float32Array(9 * count);
  for (let k = 0; k < count; k++) {
    unpackSplat(geometry, k, positions, factors, opacities);
    const [xx, yx, yy, zx, zy, zz] = factors.subarray(6 * k, 6 * k + 6);
    axes.set([xx, yx, zx, 0, yy, zy, 0, 0, zz], 9 * k);
  }
  return { count, positions, axes, opacities };
}
