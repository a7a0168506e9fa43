import { nearestNeighbors, type PointTree } from './neighbours.js';
import { PairCosts, type PairState } from './pair-costs.js';

/** Number of the nearest neighbors of a splat that are evaluated in every {@link GLANCE}-th view. */
const NEIGHBORS = 10;
/** Number of these neighbors that are evaluated in all views. */
export const FAVORITES = 4;
const GLANCE = 4;

/** Input of {@link findPartners}. */
export interface Partnering {
  readonly state: PairState;
  readonly tree: PointTree;
  /** Indices of the splats whose partners are searched. */
  readonly slots: Uint32Array;
  /** [slots, FAVORITES] found partners; undefined if `costs` is Infinity. */
  readonly partners: Uint32Array;
  /** [slots, FAVORITES] costs of merging with the found partners, as {@link PairCosts.cost}; Infinity without one. */
  readonly costs: Float32Array;
}

/** Finds the neighbors of each splat with the smallest costs of merging, and writes `partners` and `costs`. */
export function findPartners({ state, tree, slots, partners, costs: found }: Partnering): void {
  const costs = new PairCosts(state);
  const neighbors = nearestNeighbors(tree, slots, NEIGHBORS);
  const glances = new Float32Array(NEIGHBORS);
  found.fill(Infinity);
  for (let k = 0; k < slots.length; k++) {
    const i = slots[k];
    const own = neighbors.subarray(NEIGHBORS * k, NEIGHBORS * (k + 1));
    for (let n = 0; n < NEIGHBORS; n++) glances[n] = own[n] < 0 ? Infinity : costs.cost(i, own[n], GLANCE);
    for (let n = 0; n < FAVORITES; n++) {
      const best = glances.indexOf(Math.min(...glances));
      if (!Number.isFinite(glances[best])) break;
      glances[best] = Infinity;
      partners[FAVORITES * k + n] = own[best];
      found[FAVORITES * k + n] = costs.cost(i, own[best]);
    }
  }
}
