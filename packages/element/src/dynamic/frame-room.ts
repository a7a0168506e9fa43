/** Prefetch time of frames, and their maximum total size in memory; two frames are always kept. */
const AHEAD_SECONDS = 2;
const MOST_BYTES = 256 << 20;
const LEAST_FRAMES = 2;

/**
 * Determines how many frames of a sequence are kept: fewer as soon as larger ones arrive, because the first frame may
 * be the smallest.
 */
export class FrameRoom {
  readonly #most: number;
  #largestBytes = 1;

  /** @param length Number of frames in the whole sequence. */
  constructor(length: number, framesPerSecond: number) {
    this.#most = Math.min(length, Math.ceil(AHEAD_SECONDS * framesPerSecond));
  }

  /** Records the size of a received frame, in bytes. */
  note(byteLength: number): void {
    this.#largestBytes = Math.max(this.#largestBytes, byteLength);
  }

  /** Maximum number of frames in memory, including the current one. */
  get frames(): number {
    return Math.max(LEAST_FRAMES, Math.min(this.#most, Math.floor(MOST_BYTES / this.#largestBytes)));
  }
}
