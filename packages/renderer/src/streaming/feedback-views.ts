/** Views that are told apart at a time; of more, those drawn last. */
export const MOST_VIEWS = 4;

interface ViewSample {
  /** Of the scene, when it was looked at. */
  readonly version: number;
  /** It was of this view alone, not of where a camera that moves would be. */
  readonly isStill: boolean;
  /** Number of the frame that was the last to draw the view. */
  drawnAt: number;
  requests?: Float32Array;
}

/**
 * The views that a streamed scene has been looked at from: one that is drawn again as it was need not be looked at again, and what each of several wishes for is wished for until
 * another look at it. What a view depends on is its name.
 */
export class FeedbackViews {
  /** The one looked at last is the last. */
  readonly #looks = new Map<string, ViewSample>();
  #frames = 0;
  /** Frames of the last look and of the one before. */
  #sampledAt: readonly [number, number] = [0, 0];

  /** A view is drawn. @returns true if the scene was looked at from it as it is */
  draw(view: string, version: number): boolean {
    this.#frames++;
    const sample = this.#looks.get(view);
    if (sample) sample.drawnAt = this.#frames;
    return sample?.version === version && sample.isStill;
  }

  /** The view that was drawn last is looked at. */
  begin(view: string, version: number, isStill: boolean): void {
    this.#looks.delete(view);
    this.#looks.set(view, { version, isStill, drawnAt: this.#frames });
    const [oldest] = this.#looks.keys();
    if (this.#looks.size > MOST_VIEWS) this.#looks.delete(oldest);
    this.#sampledAt = [this.#frames, this.#sampledAt[0]];
  }

  /** What the last look found. @returns with it what other views wish for that are still drawn */
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

  /** Nothing that was looked at is as it was. */
  clear(): void {
    this.#looks.clear();
  }
}
