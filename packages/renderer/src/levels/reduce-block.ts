import { BLOCK, type Block } from './block.js';
import { mergeCost, mergePair } from './merge-pair.js';
import { ROW } from './splat-rows.js';

/** Number of subsequent splats in the order that are candidates for a merge with a splat. */
const WINDOW = 6;
/** Marks a cost that is not computed; costs are not negative. */
const UNKNOWN = -1;

/** Merges pairs of near neighbors in a block until the target number of splats remains. */
export class BlockReducer {
  readonly #best = new Int32Array(BLOCK);
  readonly #bestCost = new Float64Array(BLOCK);
  readonly #partOf = new Int32Array(BLOCK);
  /** Costs of the pairs of mutual partners in one round. */
  readonly #pairCosts = new Float64Array(BLOCK);
  /**
   * [count, WINDOW] costs of merging each splat with the subsequent ones. They are kept between rounds, because most
   * pairs survive a round.
   */
  readonly #costs = new Float64Array(WINDOW * BLOCK);
  /** Index before the round of each splat after the round. */
  readonly #before = new Int32Array(BLOCK);

  /**
   * Reduces a block to `target` splats. Each round merges the pairs of splats that are each other's cheapest partner;
   * the last round merges only the cheapest of these pairs.
   */
  reduce(block: Block, target: number): void {
    this.#costs.fill(UNKNOWN, 0, WINDOW * block.count);
    while (block.count > target) {
      this.#findPartners(block.rows, block.count);
      this.#mergePairs(block, block.count - target);
      this.#keepCosts(block.count);
      block.closeRanks(this.#partOf);
    }
  }

  #findPartners(rows: Float64Array, count: number): void {
    const best = this.#best;
    const bestCost = this.#bestCost;
    const costs = this.#costs;
    bestCost.fill(Infinity, 0, count);
    for (let i = 0; i < count; i++) {
      const end = Math.min(count, i + WINDOW + 1);
      for (let j = i + 1, at = WINDOW * i; j < end; j++, at++) {
        let cost = costs[at];
        if (cost === UNKNOWN) costs[at] = cost = mergeCost(rows, ROW * i, ROW * j);
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

  /**
   * Merges the cheapest pairs of mutual partners, at most `max` of them. At least one pair is merged, because the
   * cheapest of all pairs is mutual.
   */
  #mergePairs(block: Block, max: number): void {
    const best = this.#best;
    const partOf = this.#partOf;
    partOf.fill(-1, 0, block.count);
    const limit = this.#dearest(block.count, max);
    let merged = 0;
    for (let i = 0; i < block.count && merged < max; i++) {
      const j = best[i];
      if (j <= i || best[j] !== i || this.#bestCost[i] > limit) continue;
      mergePair(block.rows, ROW * i, ROW * j, block.dilation);
      partOf[j] = i;
      merged++;
    }
  }

  /** Keeps the costs of pairs whose splats were both not merged, for the next round. */
  #keepCosts(count: number): void {
    const partOf = this.#partOf;
    const before = this.#before;
    const costs = this.#costs;
    let left = 0;
    for (let k = 0; k < count; k++) if (partOf[k] < 0) before[left++] = k;
    for (let i = 0; i < left; i++) {
      const old = before[i];
      for (let step = 1; step <= WINDOW && i + step < left; step++) {
        const other = before[i + step];
        const isKept = other - old <= WINDOW && !this.#isMerged(old) && !this.#isMerged(other);
        // Moves the costs in place: the read index is never below the write index.
        costs[WINDOW * i + step - 1] = isKept ? costs[WINDOW * old + other - old - 1] : UNKNOWN;
      }
    }
  }

  /** Whether another splat was merged into splat k in this round. */
  #isMerged(k: number): boolean {
    const partner = this.#best[k];
    return this.#partOf[partner] === k;
  }

  /** Returns the largest cost among the `max` cheapest pairs of mutual partners; Infinity if no more pairs exist. */
  #dearest(count: number, max: number): number {
    const costs = this.#pairCosts;
    let pairs = 0;
    for (let i = 0; i < count; i++) {
      const j = this.#best[i];
      if (j > i && this.#best[j] === i) costs[pairs++] = this.#bestCost[i];
    }
    return pairs <= max ? Infinity : costs.subarray(0, pairs).sort()[max - 1];
  }
}
