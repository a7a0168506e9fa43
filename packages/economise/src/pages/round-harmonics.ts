import { CHROMA_CODES } from '@gaussian-splat/renderer/tools';
import type { SplatVisibility } from './seen-splats.js';

/** Maximum steps of a channel: the range of a signed byte. */
const MAX_STEPS = 127;
/** Diagonal of the root for a splat that is visible from all directions: 1 / √(4 π). */
const EVEN_PIVOT = 0.28209479177387814;
/**
 * Minimum reduction of the squared error for a step that costs more bits: zeros cost almost none, and smaller numbers
 * cost less than larger ones.
 */
const [ZERO_PRICE, STEP_PRICE] = [0.24, 0.06];

/** Luma of a color and its differences, red minus blue and green minus their mean, which are mostly small. */
export function differencesOf(sh: Float32Array, at: number): [luma: number, orange: number, green: number] {
  const middle = (sh[at] + sh[at + 2]) / 2;
  return [(middle + sh[at + 1]) / 2, sh[at] - sh[at + 2], sh[at + 1] - middle];
}

/**
 * Quantizes the coefficients of a splat's color above the constant one, from the last to the first: each compensates
 * the rounding of the previous ones in the colors of the views (successive cancellation, Babai's nearest plane).
 */
export class ShQuantizer {
  readonly #seen: SplatVisibility | undefined;
  readonly #size: number;
  /** Rounding error of each coefficient. */
  readonly #added: Float64Array;
  readonly #root: Float64Array;

  /** @param size Number of coefficients of a channel. */
  constructor(size: number, seen: SplatVisibility | undefined) {
    this.#size = size;
    this.#seen = seen;
    this.#added = new Float64Array(3 * size);
    this.#root = new Float64Array((size * (size + 1)) / 2);
  }

  /**
   * @param i Index of the splat in the cloud; undefined if its visibility is unknown.
   * @param valuesOf Returns the three numbers of a coefficient, as colors or differences.
   * @param round Is called with number `n` of coefficient k, corrected, and the weight of its error, 1 for a splat that
   * is visible from all directions; returns the rounded value.
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

  /** Correction of the constant coefficient: subtract it from the three numbers. */
  constantShift(): [number, number, number] {
    const pivot = this.#root[0];
    return [this.#shift(0, 0, pivot), this.#shift(0, 1, pivot), this.#shift(0, 2, pivot)];
  }

  /** Excess of coefficient k from the rounding of those above it. */
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

/** Quantizes lumas and color differences with steps that fit into bytes. */
export class HarmonicRounder {
  /** Codes of the last splat: all lumas, then red minus blue, then green minus their mean. */
  readonly codes: Int8Array;
  readonly #rounder: ShQuantizer;
  readonly #size: number;

  /** @param size Number of coefficients of a channel. */
  constructor(size: number, seen: SplatVisibility | undefined) {
    this.#size = size;
    this.#rounder = new ShQuantizer(size, seen);
    this.codes = new Int8Array(3 * (size - 1));
  }

  /**
   * @param at Offset of the splat's first coefficient in `sh`.
   * @param i Its index in the cloud; undefined if its visibility is unknown.
   * @param step Step of lumas.
   * @returns False if some codes were clamped.
   */
  round(sh: Float32Array, at: number, i: number | undefined, step: number): boolean {
    const { codes } = this;
    const count = this.#size - 1;
    this.#rounder.round(
      i,
      (k) => differencesOf(sh, at + 3 * k),
      (value, weight, k, n) => {
        const spacing = n === 0 ? step : CHROMA_CODES * step;
        const code = Math.sign(value) * Math.min(MAX_STEPS, roundedBy(Math.abs(value) / spacing, weight));
        codes[count * n + k - 1] = code;
        return code * spacing;
      },
    );
    for (let k = 0; k < count; k++) if (!fits(codes[k], codes[count + k], codes[2 * count + k])) return false;
    return true;
  }

  /** Correction of the constant coefficient: subtract it from its luma and its differences. */
  constantShift(): [luma: number, orange: number, green: number] {
    return this.#rounder.constantShift();
  }
}

/** Whether the channels of a luma and differences fit bytes. */
function fits(luma: number, orange: number, green: number): boolean {
  const [rest, half] = [Math.abs(luma - (CHROMA_CODES / 2) * green), (CHROMA_CODES / 2) * Math.abs(orange)];
  return (
    rest + half <= MAX_STEPS && Math.abs(luma + (CHROMA_CODES / 2) * green) <= MAX_STEPS && Math.abs(luma) < MAX_STEPS
  );
}

/** Rounds to a number of steps, with a bias towards smaller ones if an error has little weight. */
export function roundedBy(size: number, weight: number): number {
  const code = Math.floor(size + 0.5 - STEP_PRICE / 2 / weight);
  if (code > 1) return code;
  return 2 * size - 1 > ZERO_PRICE / weight ? 1 : 0;
}
