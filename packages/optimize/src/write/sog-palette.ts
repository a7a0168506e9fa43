import type { GaussianCloud } from '@gaussian-splat/core';
import { quantized, ShQuantizer } from '../pages/round-harmonics.js';
import { visibilityWeights, type SplatVisibility } from '../pages/splat-visibility.js';
import type { Palette } from './palette.js';

/**
 * `MIDDLE_CODE` is the code of 0 in the palette. Values within `EVEN_CODES` codes of 0 are evenly spaced. The largest
 * value is at most `MAX_BENT_CODE` steps.
 */
const [MIDDLE_CODE, EVEN_CODES, MAX_BENT_CODE] = [127, 48, 2000];
/**
 * Quantile of the entries' weights, 0..1: entries with this weight or more are quantized with one step. Lighter entries
 * have steps of up to 2 ** `MAX_OCTAVES`.
 */
const [REFERENCE_RANK, MAX_OCTAVES] = [0.9, 5];
/** Significant digits of the values of a codebook. More digits take more bytes, and are finer than any step. */
export const DIGITS = 6;

export interface RoundedPalette {
  /** [size, width] indices in `values`; {@link MIDDLE_CODE} stands for 0. */
  readonly codes: Uint8Array;
  /** [N] index of each splat's entry. Entries are sorted by step, and entries of equal steps by first use. */
  readonly labels: Uint32Array;
  /** Codebook: the value of each code, ascending. */
  readonly values: readonly number[];
}

/**
 * Quantizes the entries of a palette: less visible entries have larger steps. Rounding minimizes the visible error of
 * the heaviest splat that uses the entry.
 */
export function roundPalette(
  { entries, labels, size }: Palette,
  targets: { order: Uint32Array; weights: Float32Array; seen: SplatVisibility | undefined; step: number },
): RoundedPalette {
  const { order, weights, seen, step } = targets;
  const width = entries.length / size;
  const sums = new Float32Array(size);
  const heaviest = new Uint32Array(size);
  const met: number[] = [];
  const isMet = new Uint8Array(size);
  labels.forEach((label, k) => {
    if (isMet[label] === 0) {
      met.push(label);
      [isMet[label], heaviest[label]] = [1, k];
    } else if (weights[k] > weights[heaviest[label]]) heaviest[label] = k;
    sums[label] += weights[k];
  });
  const reference = sums.slice().sort()[Math.floor(REFERENCE_RANK * (size - 1))];
  const octaves = Uint8Array.from(sums, (sum) =>
    Math.min(MAX_OCTAVES, Math.max(0, Math.round(Math.log2(reference / Math.max(1e-36, sum)) / 2))),
  );
  // Neighbors in the image with equal steps have common codes.
  const numbers = new Uint32Array(size);
  met.sort((a, b) => octaves[a] - octaves[b]).forEach((entry, number) => (numbers[entry] = number));
  const scale = new CodeScale(
    step,
    entries.reduce((max, value) => Math.max(max, Math.abs(value)), 0),
  );
  const codes = new Uint8Array(entries.length);
  const rounder = new ShQuantizer(width / 3 + 1, seen);
  for (let entry = 0; entry < size; entry++) {
    const unit = 2 ** octaves[entry];
    const [from, to] = [width * entry, width * numbers[entry]];
    rounder.round(
      order[heaviest[entry]],
      (k) => entries.subarray(from + 3 * (k - 1), from + 3 * k) as unknown as readonly number[],
      (value, weight, k, n) => {
        const code = Math.sign(value) * scale.codeOf(Math.abs(value), unit, weight);
        codes[to + 3 * (k - 1) + n] = MIDDLE_CODE + code;
        return scale.valueOf(code);
      },
    );
  }
  const values = Array.from({ length: 2 * MIDDLE_CODE + 1 }, (_, k) =>
    Number(scale.valueOf(k - MIDDLE_CODE).toPrecision(DIGITS)),
  );
  return { codes, labels: labels.map((label) => numbers[label]), values };
}

/**
 * Values of the codes -127 to 127. Codes near 0 are multiples of a step. If 127 steps do not reach the largest value, the
 * distances between larger codes increase.
 */
class CodeScale {
  readonly #step: number;
  readonly #bend: number;

  constructor(step: number, max: number) {
    this.#step = Math.max(step, max / MAX_BENT_CODE);
    this.#bend = Math.max(0, max / this.#step - MIDDLE_CODE) / (MIDDLE_CODE - EVEN_CODES) ** 2;
  }

  valueOf(code: number): number {
    const size = Math.abs(code);
    return Math.sign(code) * this.#step * (size + this.#bend * Math.max(0, size - EVEN_CODES) ** 2);
  }

  /**
   * Returns the code that quantizes a value, 0 or more.
   * @param value 0 or more.
   * @param unit The code is a multiple of this number.
   */
  codeOf(value: number, unit: number, weight: number): number {
    const steps = value / this.#step - EVEN_CODES;
    const bent = this.#bend > 0 && steps > 0 ? (Math.sqrt(1 + 4 * this.#bend * steps) - 1) / (2 * this.#bend) : steps;
    const code = unit * quantized((EVEN_CODES + bent) / unit, weight);
    return Math.min(code, unit * Math.floor(MIDDLE_CODE / unit));
  }
}

/**
 * Returns the weight of a squared error of each splat of `order`: from the visibility if it is known, otherwise squared
 * opacity times area.
 */
export function weightsOf(
  { opacities, scales }: GaussianCloud,
  order: Uint32Array,
  seen: SplatVisibility | undefined,
): Float32Array {
  const usual = Float32Array.from(order, (i) => {
    const [a, b, c] = scales.subarray(3 * i, 3 * i + 3);
    return opacities[i] ** 2 * (Math.max(a * b, b * c, a * c) + 1e-20);
  });
  return seen
    ? visibilityWeights(
        usual,
        Float32Array.from(order, (i) => seen.energies[i]),
      ).weights
    : usual;
}

/**
 * Returns the constant coefficients that best replace some harmonics in the visible directions: [N, 3], 0 if visibility
 * is unknown. With M the mean of Y Yᵀ, each is the sum of M_j0 / M_00 times coefficient j. The first column of a root of
 * M has the same quotients.
 * @param of Returns coefficient and channel `n` of the splat at position k of the order.
 */
export function addedBy(
  of: (k: number, n: number) => number,
  order: Uint32Array,
  width: number,
  seen: SplatVisibility | undefined,
): Float32Array {
  const added = new Float32Array(3 * order.length);
  if (!seen?.roots.length) return added;
  const numbers = ((width / 3 + 1) * (width / 3 + 2)) / 2;
  order.forEach((i, k) => {
    if (!(seen.energies[i] > 0)) return;
    const root = seen.roots.subarray(numbers * i, numbers * (i + 1));
    for (let n = 0; n < width; n++) {
      const j = 1 + Math.floor(n / 3);
      added[3 * k + (n % 3)] += (root[(j * (j + 1)) / 2] / root[0]) * of(k, n);
    }
  });
  return added;
}
