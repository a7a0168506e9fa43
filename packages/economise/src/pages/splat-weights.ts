import { FACTOR_NUMBERS, rowLengths, type SplatLevel } from '@gaussian-splat/renderer/tools';
import { weighSplats } from './seen-splats.js';

/** The share of splats that weigh less than the one that the first class is of. */
const REFERENCE_RANK = 0.9;

/** How much an error of a splat's colour adds to the squared error of pictures: the square of its opacity, times the area that it covers. */
function weightOf({ factors, opacities }: SplatLevel, i: number): number {
  const lengths = new Float64Array(3);
  rowLengths(factors, FACTOR_NUMBERS * i, lengths);
  lengths.sort();
  return opacities[i] ** 2 * lengths[1] * lengths[2];
}

/** How many octaves splats weigh less than those that show much. */
export class SplatWeights {
  readonly #leaves: SplatLevel;
  /** Of the leaves. */
  readonly #weights: Float32Array;
  readonly #unit: number;
  /** The weight that the first class is of. */
  readonly #reference: number;

  constructor(leaves: SplatLevel, energies: Float32Array | undefined) {
    this.#leaves = leaves;
    const usual = Float32Array.from({ length: leaves.count }, (_, i) => weightOf(leaves, i));
    const own = energies && usual.map((_, i) => energies[numberOf(leaves, i)]);
    ({ weights: this.#weights, unit: this.#unit } = own ? weighSplats(usual, own) : { weights: usual, unit: 1 });
    this.#reference = this.#weights.slice().sort()[Math.floor(REFERENCE_RANK * (leaves.count - 1))];
  }

  below(level: SplatLevel, i: number): number {
    const weight = level === this.#leaves ? this.#weights[i] : this.#unit * weightOf(level, i);
    return Math.log2(this.#reference / Math.max(1e-36, weight)) / 2;
  }
}

/** The number of a level's splat in the arrays that its harmonics are in. */
export const numberOf = ({ shOrder }: SplatLevel, i: number): number => (shOrder ? shOrder[i] : i);
