import type { GaussianCloud } from '@gaussian-splat/core';
import { roundedBy, ShQuantizer } from '../pages/round-harmonics.js';
import { visibilityWeights, type SplatVisibility } from '../pages/seen-splats.js';
import type { Palette } from './palette.js';

/**
 * The code of 0 in the palette; codes within {@link EVEN_CODES} of it are evenly spaced, and the largest is at most
 * {@link MAX_BENT_CODE} steps.
 */
const [MIDDLE_CODE, EVEN_CODES, MAX_BENT_CODE] = [127, 48, 2000];
/**
 * Rank of the weight, as a fraction of the entries, that gets the usual step, and the maximum octaves of larger steps.
 */
const [REFERENCE_RANK, MAX_OCTAVES] = [0.9, 5];
/** Digits of the values of a codebook: more take more bytes, and are finer than any step. */
export const DIGITS = 6;

export interface RoundedPalette {
  /** [size, width], {@link MIDDLE_CODE} for 0 */
  readonly codes: Uint8Array;
  /** The entries are reordered: by step, and within equal steps by first use. */
  readonly labels: Uint32Array;
  /** The codebook. */
  readonly values: readonly number[];
}

/** Quantizes palette entries, each according to its visibility, optimized for the most visible splat that uses it. */
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
 * Values of codes -127 to 127: multiples of a step near 0, and if their range is too small, with increasing distances
 * farther away.
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

  /** @param unit Codes are multiples of it. */
  codeOf(value: number, unit: number, weight: number): number {
    const steps = value / this.#step - EVEN_CODES;
    const bent = this.#bend > 0 && steps > 0 ? (Math.sqrt(1 + 4 * this.#bend * steps) - 1) / (2 * this.#bend) : steps;
    const code = unit * roundedBy((EVEN_CODES + bent) / unit, weight);
    return Math.min(code, unit * Math.floor(MIDDLE_CODE / unit));
  }
}

/** Weight of an error of each splat. */
export function weightsOf(
  { opacities, scales }: GaussianCloud,
  order: Uint32Array,
  seen: SplatVisibility | undefined,
): Float32Array {
  const usual = Float32Array.from(order, (i) => {
    const [a, b, c] = scales.subarray(3 * i, 3 * i + 3);
    // Squared opacity times the area.
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
 * Mean constant coefficients of the visible colors of some harmonics: with M the mean of Y Yᵀ, the sum of M_j0 / M_00
 * times coefficient j; a root of M has the same quotients in its first column.
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
