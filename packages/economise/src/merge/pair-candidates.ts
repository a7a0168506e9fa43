import { nearestNeighbors, type PointTree } from './neighbours.js';
import { PairCosts, type PairState } from './pair-costs.js';

/** Candidate neighbors for merging, and the number of them that are evaluated in all views instead of in every fourth. */
const NEIGHBORS = 10;
export const FAVOURITES = 4;
const GLANCE = 4;

/** A task to find the partners of some splats. */
export interface Partnering {
  readonly state: PairState;
  readonly tree: PointTree;
  /** Indices of the splats. */
  readonly slots: Uint32Array;
  /** [slots, FAVOURITES] resulting partners, and the costs of merging: Infinity for none. */
  readonly partners: Uint32Array;
  readonly costs: Float32Array;
}

/** Finds the most similar neighbors of each splat. */
export function findPartners({ state, tree, slots, partners, costs: found }: Partnering): void {
  const costs = new PairCosts(state);
  const neighbors = nearestNeighbors(tree, slots, NEIGHBORS);
  const glances = new Float32Array(NEIGHBORS);
  found.fill(Infinity);
  for (let k = 0; k < slots.length; k++) {
    const i = slots[k];
    const own = neighbors.subarray(NEIGHBORS * k, NEIGHBORS * (k + 1));
    for (let n = 0; n < NEIGHBORS; n++) glances[n] = own[n] < 0 ? Infinity : costs.cost(i, own[n], GLANCE);
    for (let n = 0; n < FAVOURITES; n++) {
      const best = glances.indexOf(Math.min(...glances));
      if (!Number.isFinite(glances[best])) break;
      glances[best] = Infinity;
      partners[FAVOURITES * k + n] = own[best];
      found[FAVOURITES * k + n] = costs.cost(i, own[best]);
    }
  }
}
