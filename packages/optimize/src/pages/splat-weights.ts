import { FACTOR_NUMBERS, rowLengths, type SplatLevel } from '@gaussian-splat/renderer/tools';
import { visibilityWeights } from './splat-visibility.js';

/** Rank of the weight that defines the first class, as a fraction of the splats. */
const REFERENCE_RANK = 0.9;

/** Returns the estimated weight of a splat's squared color error in images: its squared opacity times its area. */
function weightOf({ factors, opacities }: SplatLevel, i: number): number {
  const lengths = new Float64Array(3);
  rowLengths(factors, FACTOR_NUMBERS * i, lengths);
  lengths.sort();
  return opacities[i] ** 2 * lengths[1] * lengths[2];
}

/** Returns the estimated weight of a well visible splat of a level. */
export function referenceWeight(level: SplatLevel): number {
  return referenceOf(Float32Array.from({ length: level.count }, (_, i) => weightOf(level, i)));
}

const referenceOf = (weights: Float32Array): number =>
  weights.slice().sort()[Math.floor(REFERENCE_RANK * (weights.length - 1))];

/** Weights of splats relative to the most visible ones. */
export class SplatWeights {
  readonly #leaves: SplatLevel;
  /** Weights of the splats of the finest level, if they were measured. */
  readonly #weights: Float32Array | undefined;
  readonly #unit: number;
  /** Weight of the first class. */
  readonly #reference: number;

  /** @param reference The {@link referenceWeight} of the scene, which counts if there are no `energies`. */
  constructor(leaves: SplatLevel, reference: number, energies: Float32Array | undefined) {
    this.#leaves = leaves;
    if (energies === undefined) {
      [this.#unit, this.#reference] = [1, reference];
      return;
    }
    const usual = Float32Array.from({ length: leaves.count }, (_, i) => weightOf(leaves, i));
    const own = usual.map((_, i) => energies[numberOf(leaves, i)]);
    ({ weights: this.#weights, unit: this.#unit } = visibilityWeights(usual, own));
    this.#reference = referenceOf(this.#weights);
  }

  below(level: SplatLevel, i: number): number {
    const weight = level === this.#leaves && this.#weights ? this.#weights[i] : this.#unit * weightOf(level, i);
    return Math.log2(this.#reference / Math.max(1e-36, weight)) / 2;
  }
}

/** Returns the index of a level's splat in the arrays of spherical harmonics. */
export const numberOf = ({ shOrder }: SplatLevel, i: number): number => (shOrder ? shOrder[i] : i);
