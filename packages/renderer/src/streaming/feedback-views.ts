/** Maximum number of views that are tracked; the most recently drawn ones are kept. */
export const MAX_VIEWS = 4;

interface ViewSample {
  /** Version of the scene at the feedback pass. */
  readonly version: number;
  /** Whether the pass used only this view, without the predicted one of a moving camera. */
  readonly isStill: boolean;
  /** Index of the last frame that drew the view. */
  drawnAt: number;
  requests?: Float32Array;
}

/**
 * Views with a feedback pass: a view that is drawn again unchanged needs no other pass, and the requests of each view
 * stay valid until its next pass. A view is identified by all parameters that it depends on.
 */
export class FeedbackViews {
  /** The most recent one is last. */
  readonly #looks = new Map<string, ViewSample>();
  #frames = 0;
  /** Frames at the last two feedback passes. */
  #sampledAt: readonly [number, number] = [0, 0];

  /** Records that a view is drawn. @returns Whether a feedback pass of the unchanged scene exists for it. */
  draw(view: string, version: number): boolean {
    this.#frames++;
    const sample = this.#looks.get(view);
    if (sample) sample.drawnAt = this.#frames;
    return sample?.version === version && sample.isStill;
  }

  /** Starts a feedback pass of the last drawn view. */
  begin(view: string, version: number, isStill: boolean): void {
    this.#looks.delete(view);
    this.#looks.set(view, { version, isStill, drawnAt: this.#frames });
    const [oldest] = this.#looks.keys();
    if (this.#looks.size > MAX_VIEWS) this.#looks.delete(oldest);
    this.#sampledAt = [this.#frames, this.#sampledAt[0]];
  }

  /** Records the result of the pass. @returns It combined with the requests of the other views that are still drawn. */
  end(requests: Float32Array): Float32Array {
    const last = [...this.#looks.values()].at(-1);
    if (last === undefined) return requests;
    last.requests = requests;
    const merged = requests.slice();
    for (const sample of this.#looks.values()) {
      if (sample === last || sample.requests === undefined || sample.drawnAt <= this.#sampledAt[1]) continue;
      for (let page = 0; page < merged.length; page++) merged[page] = Math.max(merged[page], sample.requests[page]);
    }
    return merged;
  }

  /** Discards all passes. */
  clear(): void {
    this.#looks.clear();
  }
}
