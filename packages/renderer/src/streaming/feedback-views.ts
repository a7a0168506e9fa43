/** Maximum number of views that are tracked. The views with the most recent feedback passes are kept. */
export const MAX_VIEWS = 4;

interface ViewSample {
  /** Version of the scene at the feedback pass of the view. */
  readonly version: number;
  /** Whether the pass used only this view, without the predicted view of a moving camera. */
  readonly isStill: boolean;
  /** Index of the last frame that drew the view. */
  drawnAt: number;
  /** Result of the pass; undefined until it is read back. */
  requests?: Float32Array;
}

/**
 * Views with a feedback pass. A view that is drawn again unchanged needs no other pass, and the requests of each view
 * are valid until its next pass. The name of a view contains all parameters that its requests depend on.
 */
export class FeedbackViews {
  /** Views by name; the one with the most recent pass is last. */
  readonly #looks = new Map<string, ViewSample>();
  #frames = 0;
  /** Frame indices of the last two feedback passes, the most recent first. */
  #sampledAt: readonly [number, number] = [0, 0];

  /**
   * Records that a view is drawn.
   * @returns Whether the view has a feedback pass for this version of the scene, taken with a resting camera.
   */
  draw(view: string, version: number): boolean {
    this.#frames++;
    const sample = this.#looks.get(view);
    if (sample) sample.drawnAt = this.#frames;
    return sample?.version === version && sample.isStill;
  }

  /** Records the beginning of a feedback pass, for the last drawn view. */
  begin(view: string, version: number, isStill: boolean): void {
    this.#looks.delete(view);
    this.#looks.set(view, { version, isStill, drawnAt: this.#frames });
    const [oldest] = this.#looks.keys();
    if (this.#looks.size > MAX_VIEWS) this.#looks.delete(oldest);
    this.#sampledAt = [this.#frames, this.#sampledAt[0]];
  }

  /**
   * Records the result of the last pass.
   * @param requests Screen error of each missing page in pixels.
   * @returns The maximum, for each page, over this result and those of the other views that are still drawn.
   */
  end(requests: Float32Array): Float32Array {
    const last = [...this.#looks.values()].at(-1);
    if (last === undefined) return requests;
    last.requests = requests;
    const merged = requests.slice();
    for (const sample of this.#looks.values()) {
      if (sample === last || sample.requests === undefined || sample.drawnAt <= this.#sampledAt[1]) continue;
      const { requests: others } = sample;
      // Pages may have been added to the scene since.
      for (let page = 0; page < Math.min(merged.length, others.length); page++)
        merged[page] = Math.max(merged[page], others[page]);
    }
    return merged;
  }

  /** Discards all views and their requests. */
  clear(): void {
    this.#looks.clear();
  }
}
