/** A threshold and the mean squared error there. */
export interface Found {
  readonly threshold: number;
  readonly error: number;
}

/** How much of a quantity goes with a threshold, measured at some and told between them. */
export class Curve {
  readonly #samples: Found[] = [];
  readonly #measure: (threshold: number) => Promise<number>;

  /** @param measure mean squared error at a threshold; grows with it. */
  constructor(measure: (threshold: number) => Promise<number>) {
    this.#measure = measure;
  }

  /**
   * The largest threshold in `low`..`high`, both above 0, whose error stays within `budget`; `low` if even that exceeds it. Bisects the
   * logarithm, and measures only where it has not yet.
   */
  async thresholdFor(budget: number, low: number, high: number, steps = 7): Promise<Found> {
    const atHigh = await this.#errorAt(high);
    if (atHigh <= budget) return { threshold: high, error: atHigh };
    let [below, above] = [low, high];
    for (let step = 0; step < steps; step++) {
      const middle = Math.sqrt(below * above);
      if ((await this.#errorAt(middle)) <= budget) below = middle;
      else above = middle;
    }
    return { threshold: below, error: await this.#errorAt(below) };
  }

  async #errorAt(threshold: number): Promise<number> {
    const known = this.#samples.find((sample) => Math.abs(Math.log(sample.threshold / threshold)) < 1e-9);
    if (known) return known.error;
    const error = await this.#measure(threshold);
    this.#samples.push({ threshold, error });
    return error;
  }
}
