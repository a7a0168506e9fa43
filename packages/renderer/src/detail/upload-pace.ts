/** Share of the time between two frames that placing pages may take of the page's thread, and its bounds in milliseconds. */
const SHARE = 1 / 8;
const [LEAST_MS, MOST_MS] = [1, 4];
/** Most bytes for one frame, whatever they cost the thread: what the GPU process and the GPU do with them is not measured. */
export const MOST_UPLOAD_BYTES = 8e6;
/** What bytes are thought to cost before any has been uploaded: that of 650 MB a second. */
const [FIRST_MS, FIRST_BYTES] = [2, 1.3e6];
/** How much an upload counts when the next one has been made: clocks of browsers that tick once a millisecond come out right on average. */
const MEMORY = 0.9;

/**
 * How many bytes a frame may upload: what an eighth of the time between frames is enough for, by what earlier uploads took, and never more than
 * {@link MOST_UPLOAD_BYTES}.
 */
export class UploadPace {
  #milliseconds = FIRST_MS;
  #bytes = FIRST_BYTES;
  #frameAt = -Infinity;

  /**
   * Starts a frame.
   * @param now milliseconds
   * @returns bytes that it may upload
   */
  startFrame(now: number): number {
    const allowed = Math.min(MOST_MS, Math.max(LEAST_MS, SHARE * (now - this.#frameAt)));
    this.#frameAt = now;
    return Math.min(MOST_UPLOAD_BYTES, (allowed * this.#bytes) / Math.max(1e-3, this.#milliseconds));
  }

  /** Takes note of what uploading took. */
  note(bytes: number, milliseconds: number): void {
    this.#bytes = MEMORY * this.#bytes + bytes;
    this.#milliseconds = MEMORY * this.#milliseconds + milliseconds;
  }
}
