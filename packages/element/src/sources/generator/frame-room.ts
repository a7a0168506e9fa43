/**
 * Duration for which frames are prefetched, s; their maximum total size in memory, bytes; and their minimum number,
 * which is kept regardless of their size.
 */
const AHEAD_SECONDS = 2;
const MAX_BYTES = 256 << 20;
const MIN_FRAMES = 2;

/**
 * Determines how many frames of a sequence are kept in memory. The number decreases when larger frames arrive, because
 * the first frame may be the smallest.
 */
export class FrameRoom {
  readonly #max: number;
  #largestBytes = 1;

  /** @param length Number of frames in the sequence. */
  constructor(length: number, framesPerSecond: number) {
    this.#max = Math.min(length, Math.ceil(AHEAD_SECONDS * framesPerSecond));
  }

  /** Records the size of a received frame, in bytes. */
  note(byteLength: number): void {
    this.#largestBytes = Math.max(this.#largestBytes, byteLength);
  }

  /** Maximum number of frames in memory, including the current one. */
  get frames(): number {
    return Math.max(MIN_FRAMES, Math.min(this.#max, Math.floor(MAX_BYTES / this.#largestBytes)));
  }
}
