/** How far ahead frames are fetched, and bytes of all of them that are kept in the page's memory; two frames always are. */
const AHEAD_SECONDS = 2;
const MOST_BYTES = 256 << 20;
const LEAST_FRAMES = 2;

/** How many frames of a sequence are held: fewer as soon as larger ones come, since a first frame may be the smallest. */
export class FrameRoom {
  readonly #most: number;
  #largestBytes = 1;

  /** @param length frames of the whole sequence */
  constructor(length: number, framesPerSecond: number) {
    this.#most = Math.min(length, Math.ceil(AHEAD_SECONDS * framesPerSecond));
  }

  /** A frame of this size, bytes, has come. */
  note(byteLength: number): void {
    this.#largestBytes = Math.max(this.#largestBytes, byteLength);
  }

  /** Frames that there is room for, the one on show included. */
  get frames(): number {
    return Math.max(LEAST_FRAMES, Math.min(this.#most, Math.floor(MOST_BYTES / this.#largestBytes)));
  }
}
