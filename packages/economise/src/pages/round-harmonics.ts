import { CHROMA_CODES } from '@gaussian-splat/renderer/tools';
import type { SeenSplats } from './seen-splats.js';

/** Of a channel, in steps: what a signed byte holds. */
const MOST_STEPS = 127;
/** What the root of a splat that is seen from everywhere has in its diagonal: 1 / √(4 π). */
const EVEN_PIVOT = 0.28209479177387814;
/** A step that costs a bit more has to be worth that much of its square: zeros cost hardly a bit, and of two other numbers the smaller costs less. */
const [ZERO_PRICE, STEP_PRICE] = [0.24, 0.06];

/** A colour's luma and its differences of colours, red less blue and green less their mean: of most colours these are small. */
export function differencesOf(sh: Float32Array, at: number): [luma: number, orange: number, green: number] {
  const middle = (sh[at] + sh[at + 2]) / 2;
  return [(middle + sh[at + 1]) / 2, sh[at] - sh[at + 2], sh[at + 1] - middle];
}

/**
 * Rounds the coefficients of a splat's colour above the constant one, from the last to the first: each makes up for what the rounding of those before it has changed in the colours that the views see (successive
 * cancellation, Babai's nearest plane).
 */
export class SeenRounder {
  readonly #seen: SeenSplats | undefined;
  readonly #size: number;
  /** What rounding added to each coefficient. */
  readonly #added: Float64Array;
  readonly #root: Float64Array;

  /** @param size coefficients of a channel */
  constructor(size: number, seen: SeenSplats | undefined) {
    this.#size = size;
    this.#seen = seen;
    this.#added = new Float64Array(3 * size);
    this.#root = new Float64Array((size * (size + 1)) / 2);
  }

  /**
   * @param i number of the splat in the cloud; undefined for one that views tell nothing of
   * @param valuesOf the three numbers of a coefficient, of colours or of what they are made of
   * @param round gets number `n` of coefficient k, corrected, and how much an error of it weighs, 1 for one that is seen from everywhere; returns what it becomes
   */
  round(
    i: number | undefined,
    valuesOf: (k: number) => readonly number[],
    round: (value: number, weight: number, k: number, n: number) => number,
  ): void {
    this.#readRoot(i);
    for (let k = this.#size - 1; k > 0; k--) {
      const pivot = this.#root[(k * (k + 3)) / 2];
      const weight = (pivot / EVEN_PIVOT) ** 2;
      const values = valuesOf(k);
      for (let n = 0; n < 3; n++) {
        this.#added[3 * k + n] = round(values[n] - this.#shift(k, n, pivot), weight, k, n) - values[n];
      }
    }
  }

  /** What the constant coefficient makes up for: to be taken from its three numbers. */
  constantShift(): [number, number, number] {
    const pivot = this.#root[0];
    return [this.#shift(0, 0, pivot), this.#shift(0, 1, pivot), this.#shift(0, 2, pivot)];
  }

  /** How much coefficient k has too much already, by what was added to those above it. */
  #shift(k: number, n: number, pivot: number): number {
    let sum = 0;
    for (let j = k + 1; j < this.#size; j++) sum += this.#root[(j * (j + 1)) / 2 + k] * this.#added[3 * j + n];
    return sum / pivot;
  }

  #readRoot(i: number | undefined): void {
    const { length } = this.#root;
    if (this.#seen?.roots.length && i !== undefined && this.#seen.energies[i] > 0) {
      this.#root.set(this.#seen.roots.subarray(length * i, length * (i + 1)));
      return;
    }
    this.#root.fill(0);
    for (let k = 0; k < this.#size; k++) this.#root[(k * (k + 3)) / 2] = EVEN_PIVOT;
  }
}

/** Rounds colours' lumas and differences to steps that fit into bytes. */
export class HarmonicRounder {
  /** Of the last splat: all lumas, then red less blue, then green less their mean. */
  readonly codes: Int8Array;
  readonly #rounder: SeenRounder;
  readonly #size: number;

  /** @param size coefficients of a channel */
  constructor(size: number, seen: SeenSplats | undefined) {
    this.#size = size;
    this.#rounder = new SeenRounder(size, seen);
    this.codes = new Int8Array(3 * (size - 1));
  }

  /**
   * @param at of the splat's first coefficient in `sh`
   * @param i its number in the cloud; undefined for one that views tell nothing of
   * @param step between two lumas
   * @returns false if some had to be cut
   */
  round(sh: Float32Array, at: number, i: number | undefined, step: number): boolean {
    const { codes } = this;
    const count = this.#size - 1;
    this.#rounder.round(
      i,
      (k) => differencesOf(sh, at + 3 * k),
      (value, weight, k, n) => {
        const spacing = n === 0 ? step : CHROMA_CODES * step;
        const code = Math.sign(value) * Math.min(MOST_STEPS, roundedBy(Math.abs(value) / spacing, weight));
        codes[count * n + k - 1] = code;
        return code * spacing;
      },
    );
    for (let k = 0; k < count; k++) if (!fits(codes[k], codes[count + k], codes[2 * count + k])) return false;
    return true;
  }

  /** What the constant coefficient makes up for: to be taken from its luma and its differences. */
  constantShift(): [luma: number, orange: number, green: number] {
    return this.#rounder.constantShift();
  }
}

/** Whether the channels that a luma and differences make are bytes. */
function fits(luma: number, orange: number, green: number): boolean {
  const [rest, half] = [Math.abs(luma - (CHROMA_CODES / 2) * green), (CHROMA_CODES / 2) * Math.abs(orange)];
  return (
    rest + half <= MOST_STEPS &&
    Math.abs(luma + (CHROMA_CODES / 2) * green) <= MOST_STEPS &&
    Math.abs(luma) < MOST_STEPS
  );
}

/** A whole number of steps, from which a smaller one is near enough where an error weighs little. */
export function roundedBy(size: number, weight: number): number {
  const code = Math.floor(size + 0.5 - STEP_PRICE / 2 / weight);
  if (code > 1) return code;
  return 2 * size - 1 > ZERO_PRICE / weight ? 1 : 0;
}
