import { BLOCK, type Block } from './block.js';
import { mergeCost, mergePair, traitsOf } from './merge-pair.js';

/** How many of the splats that follow in the order may become a splat's partner. */
const WINDOW = 6;
/** Share of the pairs that want each other that are merged in one round, the cheapest. */
const ROUND_SHARE = 1;

/** Merges pairs of near neighbours until a number of splats is left. */
export class BlockReducer {
  readonly #best = new Int32Array(BLOCK);
  readonly #bestCost = new Float64Array(BLOCK);
  readonly #partOf = new Int32Array(BLOCK);
  /** Costs of the pairs of one round, ascending after {@link #cheapEnough}. */
  readonly #pairCosts = new Float64Array(BLOCK);

  /** In each round those pairs are merged that are each other's best partner, the cheapest first. */
  reduce(block: Block, target: number): void {
    while (block.count > target) {
      const traits = traitsOf(block);
      this.#findPartners(traits, block.count);
      this.#mergePairs(block, traits, block.count - target);
      block.closeRanks(this.#partOf);
    }
  }

  #findPartners(traits: Float64Array, count: number): void {
    const best = this.#best;
    const bestCost = this.#bestCost;
    bestCost.fill(Infinity, 0, count);
    for (let i = 0; i < count; i++) {
      const end = Math.min(count, i + WINDOW + 1);
      for (let j = i + 1; j < end; j++) {
        const cost = mergeCost(traits, i, j);
        if (cost < bestCost[i]) {
          bestCost[i] = cost;
          best[i] = j;
        }
        if (cost < bestCost[j]) {
          bestCost[j] = cost;
          best[j] = i;
        }
      }
    }
  }

  /** Merges at most so many pairs; always at least one, for the cheapest pair of all wants each other. */
  #mergePairs(block: Block, traits: Float64Array, most: number): void {
    this.#partOf.fill(-1, 0, block.count);
    const limit = this.#dearest(block.count, most);
    let merged = 0;
    for (let i = 0; i < block.count && merged < most; i++) {
      const j = this.#best[i];
      if (j <= i || this.#best[j] !== i || this.#bestCost[i] > limit) continue;
      mergePair(block, traits, i, j);
      this.#partOf[j] = i;
      merged++;
    }
  }

  /** Cost of the dearest pair that is merged in this round. */
  #dearest(count: number, most: number): number {
    const costs = this.#pairCosts;
    let pairs = 0;
    for (let i = 0; i < count; i++) {
      const j = this.#best[i];
      if (j > i && this.#best[j] === i) costs[pairs++] = this.#bestCost[i];
    }
    const sorted = costs.subarray(0, pairs).sort();
    return sorted[Math.max(0, Math.min(most, Math.ceil(ROUND_SHARE * pairs)) - 1)];
  }
}
