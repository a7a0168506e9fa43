import type { ShDegree, Vector3 } from '@gaussian-splat/core';
import { GaussianBuffers, type UploadOptions } from './gaussian-buffers.js';
import type { GaussianPage, GaussianScene } from './gaussian-scene.js';
import { constants } from './generated/shaders.js';
import { type PackedGaussians } from './pack/pack.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, type ShPrecision, shWords } from './pack/words.js';

const { CULL_GROUP } = constants;
/** More room than the first frame needs. */
const HEADROOM = 1.25;

/** A number of splats up to whole chunks. */
const wholeChunks = (count: number): number => CULL_GROUP * Math.max(1, Math.ceil(count / CULL_GROUP));

/**
 * Gaussians of which the content is replaced, frame by frame, by that of other packed clouds: what is bound to the buffers stays bound, and nothing is
 * allocated as long as there is room.
 */
export class SequenceGaussians implements GaussianScene {
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  readonly #device: GPUDevice;
  readonly #buffers: GaussianBuffers;
  #frame: PackedGaussians;
  #version = 1;

  private constructor(device: GPUDevice, buffers: GaussianBuffers, frame: PackedGaussians) {
    this.#device = device;
    this.#buffers = buffers;
    this.#frame = frame;
    this.shDegree = frame.shDegree;
    this.shPrecision = frame.shPrecision;
  }

  /** With the first frame, and room for a quarter more. Rejects as {@link GaussianBuffers.upload} does. */
  static async create(device: GPUDevice, frame: PackedGaussians, options?: UploadOptions): Promise<SequenceGaussians> {
    const room = wholeChunks(HEADROOM * frame.count);
    const buffers = await GaussianBuffers.upload(device, padded(frame, room), options);
    return new SequenceGaussians(device, buffers, frame);
  }

  /** Splats for which there is room. */
  get count(): number {
    return this.#buffers.count;
  }

  /** Splats of the frame. */
  get frameCount(): number {
    return this.#frame.count;
  }

  get droppedCount(): number {
    return this.#frame.droppedCount;
  }

  get antialiased(): boolean {
    return this.#frame.antialiased;
  }

  get filterVariance(): number | undefined {
    return this.#frame.filterVariance;
  }

  get origin(): Vector3 {
    return this.#frame.origin;
  }

  get pages(): readonly GaussianPage[] {
    return this.#buffers.pages;
  }

  get version(): number {
    return this.#version;
  }

  get byteLength(): number {
    return this.#buffers.byteLength;
  }

  /** True if a frame has room here, and its harmonics are kept in the same way. */
  fits({ count, shDegree, shPrecision }: PackedGaussians): boolean {
    return count <= this.count && shDegree === this.shDegree && shPrecision === this.shPrecision;
  }

  /** Replaces the content, for the frames that are submitted from now on. The frame must {@link fits}. */
  write(frame: PackedGaussians): void {
    const before = wholeChunks(this.#frame.count);
    this.#frame = frame;
    this.#version++;
    const stride = shWords(frame.shDegree, frame.shPrecision);
    const end = Math.max(wholeChunks(frame.count), Math.min(before, this.count));
    let first = 0;
    for (const page of this.pages) {
      const last = Math.min(end, first + page.count);
      if (last > first) {
        this.#writePart(page.geometry, frame.geometry, GEOMETRY_WORDS, first, last);
        this.#writePart(page.sh, frame.sh, stride, first, Math.min(last, frame.count));
        const chunks = new Uint32Array(frame.chunks.buffer, frame.chunks.byteOffset, frame.chunks.length);
        this.#writePart(page.chunks, chunks, CHUNK_NUMBERS, first / CULL_GROUP, Math.ceil(last / CULL_GROUP));
      }
      first += page.count;
    }
  }

  destroy(): void {
    this.#buffers.destroy();
  }

  /** Items `first` to `last` of an array, into a buffer that begins with the first of them; zeros behind the array's end. */
  #writePart(buffer: GPUBuffer, words: Uint32Array, stride: number, first: number, last: number): void {
    const { queue } = this.#device;
    const end = Math.min(stride * last, words.length);
    const start = Math.min(stride * first, end);
    if (end > start) queue.writeBuffer(buffer, 0, words.buffer, words.byteOffset + 4 * start, 4 * (end - start));
    const rest = stride * last - Math.max(end, stride * first);
    if (rest > 0) queue.writeBuffer(buffer, 4 * (stride * (last - first) - rest), new Uint32Array(rest));
  }
}

/** The same with splats behind that no frame shows: opacity 0. */
function padded(frame: PackedGaussians, count: number): PackedGaussians {
  const stride = shWords(frame.shDegree, frame.shPrecision);
  const geometry = new Uint32Array(GEOMETRY_WORDS * count);
  const sh = new Uint32Array(stride * count);
  const chunks = new Float32Array((CHUNK_NUMBERS * count) / CULL_GROUP);
  geometry.set(frame.geometry);
  sh.set(frame.sh);
  chunks.set(frame.chunks);
  return { ...frame, count, geometry, sh, chunks };
}
