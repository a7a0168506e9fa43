/**
 * Predicts codes of neighboring splats by a linear model that adapts to each region: recursive least squares. Splats of
 * a rigid body, for example, move by an affine function of their positions.
 *
 * Coder and decoder must predict alike, so that only operations are used that IEEE 754 rounds exactly.
 */

/** Inputs: 1, the position, the last two codes of neighbors, and the codes of the splat in two earlier planes. */
const INPUTS = 8;
/** Factor from codes to inputs, so that inputs have similar sizes. */
const UNIT = 1 / 64;
/** Weight of a splat relative to the next one: about the last 200 splats matter. */
const FORGETTING = 0.995;
const KEPT = 1 / FORGETTING;
/** Initial variance of weights, and the limit above which it is reset, because forgetting lets it grow. */
const [VARIANCE, MAX_VARIANCE] = [1000, 1e6];

export class CodePredictor {
  readonly #places: Float64Array;
  readonly #weights = new Float64Array(INPUTS);
  readonly #inputs = new Float64Array(INPUTS);
  readonly #gains = new Float64Array(INPUTS);
  readonly #covariance = new Float64Array(INPUTS * INPUTS);
  #sum = 0;

  /** @param places [splats, 3] positions, about -4 to 4. */
  constructor(places: Float64Array) {
    this.#places = places;
  }

  /** Forgets everything. */
  begin(): void {
    this.#weights.fill(0);
    this.#reset();
  }

  /** Returns the expected code of splat `i`, rounded. The other parameters are codes of neighbors. */
  expect(i: number, last: number, lastButOne: number, number: number, curve: number): number {
    const [x, w] = [this.#inputs, this.#weights];
    x[0] = 1;
    for (let k = 0; k < 3; k++) x[1 + k] = this.#places[3 * i + k];
    x[4] = last * UNIT;
    x[5] = lastButOne * UNIT;
    x[6] = number * UNIT;
    x[7] = curve * UNIT;
    let sum = 0;
    for (let k = 0; k < INPUTS; k++) sum += w[k] * x[k];
    this.#sum = sum;
    return Math.floor(sum + 0.5);
  }

  /** Adapts the model to the code whose expectation was asked for last. */
  learn(value: number): void {
    const [x, w, variance, g] = [this.#inputs, this.#weights, this.#covariance, this.#gains];
    let power = FORGETTING;
    for (let k = 0; k < INPUTS; k++) {
      let own = 0;
      for (let j = 0; j < INPUTS; j++) own += variance[INPUTS * k + j] * x[j];
      g[k] = own;
      power += own * x[k];
    }
    const error = (value - this.#sum) / power;
    for (let k = 0; k < INPUTS; k++) w[k] += g[k] * error;
    for (let k = 0; k < INPUTS; k++) {
      const own = g[k] / power;
      for (let j = 0; j <= k; j++) {
        const next = KEPT * (variance[INPUTS * k + j] - own * g[j]);
        variance[INPUTS * k + j] = next;
        variance[INPUTS * j + k] = next;
      }
      const diagonal = variance[(INPUTS + 1) * k];
      if (!(diagonal >= 0 && diagonal <= MAX_VARIANCE)) return this.#reset();
    }
  }

  #reset(): void {
    this.#covariance.fill(0);
    for (let k = 0; k < INPUTS; k++) this.#covariance[(INPUTS + 1) * k] = VARIANCE;
  }
}
