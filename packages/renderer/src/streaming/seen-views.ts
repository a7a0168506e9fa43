/** Views that are told apart at a time; of more, those drawn last. */
export const MOST_VIEWS = 4;

interface Look {
  /** Of the scene, when it was looked at. */
  readonly version: number;
  /** It was of this view alone, not of where a camera that moves would be. */
  readonly isStill: boolean;
  /** Number of the frame that was the last to draw the view. */
  drawnAt: number;
  wishes?: Float32Array;
}

/**
 * The views that a streamed scene has been looked at from: one that is drawn again as it was need not be looked at again, and what each of several wishes for is wished for until
 * another look at it. What a view depends on is its name.
 */
export class SeenViews {
  /** The one looked at last is the last. */
  readonly #looks = new Map<string, Look>();
  #frames = 0;
  /** Frames of the last look and of the one before. */
  #lookedAt: readonly [number, number] = [0, 0];

  /** A view is drawn. @returns true if the scene was looked at from it as it is */
  draw(view: string, version: number): boolean {
    this.#frames++;
    const look = this.#looks.get(view);
    if (look) look.drawnAt = this.#frames;
    return look?.version === version && look.isStill;
  }

  /** The view that was drawn last is looked at. */
  begin(view: string, version: number, isStill: boolean): void {
    this.#looks.delete(view);
    this.#looks.set(view, { version, isStill, drawnAt: this.#frames });
    const [oldest] = this.#looks.keys();
    if (this.#looks.size > MOST_VIEWS) this.#looks.delete(oldest);
    this.#lookedAt = [this.#frames, this.#lookedAt[0]];
  }

  /** What the last look found. @returns with it what other views wish for that are still drawn */
  end(wishes: Float32Array): Float32Array {
    const last = [...this.#looks.values()].at(-1);
    if (last === undefined) return wishes;
    last.wishes = wishes;
    const merged = wishes.slice();
    for (const look of this.#looks.values()) {
      if (look === last || look.wishes === undefined || look.drawnAt <= this.#lookedAt[1]) continue;
      for (let page = 0; page < merged.length; page++) merged[page] = Math.max(merged[page], look.wishes[page]);
    }
    return merged;
  }

  /** Nothing that was looked at is as it was. */
  clear(): void {
    this.#looks.clear();
  }
}
