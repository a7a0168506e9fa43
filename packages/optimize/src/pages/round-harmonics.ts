import { CHROMA_CODES } from '@gaussian-splat/renderer/tools';
import type { SplatVisibility } from './splat-visibility.js';

/** Maximum number of steps of a channel, which is that of a signed byte. */
const MAX_STEPS = 127;
/** Diagonal of the root of a splat that is visible from all directions, 1 / √(4 π). */
const EVEN_PIVOT = 0.28209479177387814;
/**
 * Minimum reduction of the squared error, in squared steps, for a code other than 0, and for a code larger by 1. Zeros
 * need almost no bits, and smaller codes fewer bits than larger ones.
 */
const [ZERO_PRICE, STEP_PRICE] = [0.24, 0.06];

/** Returns the luma of a color, and two differences that are usually small: red - blue, and green - (red + blue) / 2. */
export function differencesOf(sh: Float32Array, at: number): [luma: number, orange: number, green: number] {
  const middle = (sh[at] + sh[at + 2]) / 2;
  return [(middle + sh[at + 1]) / 2, sh[at] - sh[at + 2], sh[at + 1] - middle];
}

/**
 * Quantizer of the coefficients above the constant one, from the last to the first. Each coefficient compensates for the
 * rounding of the previous ones in the colors of the views (successive cancellation, Babai's nearest plane).
 */
export class ShQuantizer {
  readonly #seen: SplatVisibility | undefined;
  readonly #size: number;
  /** Rounding error of each coefficient. */
  readonly #added: Float64Array;
  readonly #root: Float64Array;

  /** @param size Number of coefficients of a channel, with the constant one. */
  constructor(size: number, seen: SplatVisibility | undefined) {
    this.#size = size;
    this.#seen = seen;
    this.#added = new Float64Array(3 * size);
    this.#root = new Float64Array((size * (size + 1)) / 2);
  }

  /**
   * Quantizes the coefficients of a splat.
   * @param i Index of the splat in the cloud; undefined if its visibility is unknown.
   * @param valuesOf Returns the three numbers of coefficient `k`, as colors or differences.
   * @param round Returns the rounded value of number `n` of coefficient `k`. `value` is corrected for previous rounding.
   * `weight` is that of the squared error, 1 for a splat that is visible from all directions.
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

  /** Returns the numbers to subtract from the three numbers of the constant coefficient, after {@link round}. */
  constantShift(): [number, number, number] {
    const pivot = this.#root[0];
    return [this.#shift(0, 0, pivot), this.#shift(0, 1, pivot), this.#shift(0, 2, pivot)];
  }

  /** Returns the number to subtract from number `n` of coefficient `k`, because of the rounding of higher coefficients. */
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

/** Quantizer of the coefficients above the constant one to bytes, as lumas and color differences. */
export class HarmonicRounder {
  /** Codes of the last splat: all lumas, then all differences red - blue, then all green - (red + blue) / 2. */
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
   * Quantizes the coefficients of a splat to {@link codes}.
   * @param at Index in `sh` of the splat's first number.
   * @param i Index of the splat in the cloud; undefined if its visibility is unknown.
   * @param step Step of lumas.
   * @returns Whether the codes of all channels fit into bytes.
   */
  round(sh: Float32Array, at: number, i: number | undefined, step: number): boolean {
    const { codes } = this;
    const count = this.#size - 1;
    this.#rounder.round(
      i,
      (k) => differencesOf(sh, at + 3 * k),
      (value, weight, k, n) => {
        const spacing = n === 0 ? step : CHROMA_CODES * step;
        const code = Math.sign(value) * Math.min(MAX_STEPS, quantized(Math.abs(value) / spacing, weight));
        codes[count * n + k - 1] = code;
        return code * spacing;
      },
    );
    for (let k = 0; k < count; k++) if (!fits(codes[k], codes[count + k], codes[2 * count + k])) return false;
    return true;
  }

  /** Returns the numbers to subtract from luma and differences of the constant coefficient, after {@link round}. */
  constantShift(): [luma: number, orange: number, green: number] {
    return this.#rounder.constantShift();
  }
}

/** Whether red, green and blue, in steps of lumas, fit into signed bytes. */
function fits(luma: number, orange: number, green: number): boolean {
  const [rest, half] = [Math.abs(luma - (CHROMA_CODES / 2) * green), (CHROMA_CODES / 2) * Math.abs(orange)];
  return (
    rest + half <= MAX_STEPS && Math.abs(luma + (CHROMA_CODES / 2) * green) <= MAX_STEPS && Math.abs(luma) < MAX_STEPS
  );
}

/** Rounds a number of steps that is not negative, downwards more often if the weight of its squared error is small. */
export function quantized(size: number, weight: number): number {
  const code = Math.floor(size + 0.5 - STEP_PRICE / 2 / weight);
  if (code > 1) return code;
  return 2 * size - 1 > ZERO_PRICE / weight ? 1 : 0;
}
