import type { ShDegree, Vector3 } from '@gaussian-splat/core';
import { GaussianBuffers, type UploadOptions } from './gaussian-buffers.js';
import type { GaussianBlock, GaussianScene } from './gaussian-scene.js';
import { constants } from './generated/shaders.js';
import { type PackedGaussians } from './pack/pack.js';
import { padded } from './pack/padded.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, type ShPrecision, shWords } from './pack/words.js';

const { CULL_GROUP } = constants;
/** Factor of the capacity over the number of splats in the first frame. */
const HEADROOM = 1.25;

/** Rounds a number of splats up to whole chunks of 256, at least one. */
const wholeChunks = (count: number): number => CULL_GROUP * Math.max(1, Math.ceil(count / CULL_GROUP));

/**
 * Gaussians whose content is replaced, frame by frame, by other packed clouds. Bindings stay valid, and nothing is
 * allocated while the frames fit the capacity.
 */
export class SequenceGaussians implements GaussianScene {
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  /** Capacity in splats. */
  readonly count: number;
  readonly blocks: readonly GaussianBlock[];
  readonly byteLength: number;
  readonly #device: GPUDevice;
  readonly #buffers: GaussianBuffers;
  #frame: PackedGaussians;
  #version = 1;

  private constructor(device: GPUDevice, buffers: GaussianBuffers, frame: PackedGaussians) {
    this.#device = device;
    this.#buffers = buffers;
    ({ count: this.count, blocks: this.blocks, byteLength: this.byteLength } = buffers);
    this.#frame = frame;
    this.shDegree = frame.shDegree;
    this.shPrecision = frame.shPrecision;
  }

  /**
   * Creates buffers for 1.25 times the splats of the first frame, and uploads this frame. Rejects as {@link
   * GaussianBuffers.upload} does.
   */
  static async create(device: GPUDevice, frame: PackedGaussians, options?: UploadOptions): Promise<SequenceGaussians> {
    const room = wholeChunks(HEADROOM * frame.count);
    const buffers = await GaussianBuffers.upload(device, padded(frame, room), options);
    return new SequenceGaussians(device, buffers, frame);
  }

  /** Number of splats of the current frame. */
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

  get version(): number {
    return this.#version;
  }

  /** Whether a frame fits the capacity, and its spherical harmonics have the layout of the buffers. */
  fits({ count, shDegree, shPrecision }: PackedGaussians): boolean {
    return count <= this.count && shDegree === this.shDegree && shPrecision === this.shPrecision;
  }

  /** Replaces the content for subsequent submissions. The frame must satisfy {@link fits}. */
  write(frame: PackedGaussians): void {
    const before = wholeChunks(this.#frame.count);
    this.#frame = frame;
    this.#version++;
    const stride = shWords(frame.shDegree, frame.shPrecision);
    const end = Math.max(wholeChunks(frame.count), Math.min(before, this.count));
    let first = 0;
    for (const page of this.blocks) {
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

  /**
   * Writes elements `first` to `last` of an array to the beginning of a buffer. Elements beyond the end of the array
   * become zeros.
   * @param stride Number of words of an element.
   */
  #writePart(buffer: GPUBuffer, words: Uint32Array, stride: number, first: number, last: number): void {
    const { queue } = this.#device;
    const end = Math.min(stride * last, words.length);
    const start = Math.min(stride * first, end);
    if (end > start) queue.writeBuffer(buffer, 0, words.buffer, words.byteOffset + 4 * start, 4 * (end - start));
    const rest = stride * last - Math.max(end, stride * first);
    if (rest > 0) queue.writeBuffer(buffer, 4 * (stride * (last - first) - rest), new Uint32Array(rest));
  }
}
