/** Share of the time between two frames that placing pages may take of the page's thread: at first and at least, and at most. */
export const UPLOAD_SHARE = { least: 1 / 8, most: 1 / 4 } as const;
/** How much the share grows with a frame that uploaded all it might and was followed in time by the next. */
const GROWTH = 1 / 512;
/** Bounds in milliseconds. */
const [LEAST_MS, MOST_MS] = [1, 5];
/**
 * Most bytes for one frame, whatever they cost the thread: what the GPU process and the GPU do with them is not measured. With so many in each frame few were late, with 20 MB
 * intervals of up to 110 ms were seen (docs/lod-format.md).
 */
export const MOST_UPLOAD_BYTES = 14e6;
/** What bytes are thought to cost before any has been uploaded: that of 650 MB a second. */
const [FIRST_MS, FIRST_BYTES] = [2, 1.3e6];
/** How much an upload counts when the next one has been made: clocks of browsers that tick once a millisecond come out right on average. */
const MEMORY = 0.9;
/** A frame is late that comes so many times later than usual; frames later than the bound say that the page was hidden or rested. */
const LATE = 1.75;
const PAUSE_MS = 250;
/** How fast the usual time between frames follows shorter and longer ones: a time that one frame in nine falls short of, for a page that draws every other frame is late all the time. */
const [FALLS, RISES] = [1 / 8, 1 / 64];
/** Share of what a frame might upload from which on it counts as all. */
const FULL = 0.75;

/**
 * How many bytes a frame may upload: what a share of the time between frames is enough for, by what earlier uploads took, and never more than
 * {@link MOST_UPLOAD_BYTES}. The share grows by a little while frames that use it up come in time, and is halved when one comes late
 * (additive increase, multiplicative decrease: Chiu and Jain, 1989).
 */
export class UploadPace {
  #milliseconds = FIRST_MS;
  #bytes = FIRST_BYTES;
  #frameAt = -Infinity;
  #share: number = UPLOAD_SHARE.least;
  /** Milliseconds between frames; 0 before there are two. */
  #usual = 0;
  #allowed = 0;
  #used = 0;

  /** The share that the next frame may take. */
  get share(): number {
    return this.#share;
  }

  /**
   * Starts a frame.
   * @param now milliseconds
   * @returns bytes that it may upload
   */
  startFrame(now: number): number {
    const interval = now - this.#frameAt;
    this.#frameAt = now;
    this.#adapt(interval);
    const usual = this.#usual === 0 ? interval : Math.min(interval, this.#usual);
    const most = Math.min(MOST_MS, Math.max(LEAST_MS, this.#share * usual));
    this.#allowed = Math.min(MOST_UPLOAD_BYTES, (most * this.#bytes) / Math.max(1e-3, this.#milliseconds));
    this.#used = 0;
    return this.#allowed;
  }

  /** Takes note of what uploading took. */
  note(bytes: number, milliseconds: number): void {
    this.#used += bytes;
    this.#bytes = MEMORY * this.#bytes + bytes;
    this.#milliseconds = MEMORY * this.#milliseconds + milliseconds;
  }

  #adapt(interval: number): void {
    if (interval > PAUSE_MS) return;
    if (this.#usual === 0) this.#usual = interval;
    if (interval > LATE * this.#usual) {
      // Whatever made the frame late, it had no time to spare.
      if (this.#used > 0) this.#share = Math.max(UPLOAD_SHARE.least, this.#share / 2);
    } else if (this.#used >= FULL * this.#allowed) {
      this.#share = Math.min(UPLOAD_SHARE.most, this.#share + GROWTH);
    }
    this.#usual += (interval < this.#usual ? FALLS : RISES) * (interval - this.#usual);
  }
}
