import { nearestNeighbours, type PointTree } from './neighbours.js';
import { PairCosts, type PairState } from './pair-costs.js';

/** Neighbours that a splat may be merged with, and how many of them are looked at in all views rather than in every fourth. */
const NEIGHBOURS = 10;
export const FAVOURITES = 4;
const GLANCE = 4;

/** Partners of some splats, to be found. */
export interface Partnering {
  readonly state: PairState;
  readonly tree: PointTree;
  /** Numbers of the splats. */
  readonly slots: Uint32Array;
  /** [slots, FAVOURITES] where the partners go, and what becoming one would cost: Infinity where there is none. */
  readonly partners: Uint32Array;
  readonly costs: Float32Array;
}

/** Finds for each splat those of its neighbours that it looks most alike with. */
export function findPartners({ state, tree, slots, partners, costs: found }: Partnering): void {
  const costs = new PairCosts(state);
  const neighbours = nearestNeighbours(tree, slots, NEIGHBOURS);
  const glances = new Float32Array(NEIGHBOURS);
  found.fill(Infinity);
  for (let k = 0; k < slots.length; k++) {
    const i = slots[k];
    const own = neighbours.subarray(NEIGHBOURS * k, NEIGHBOURS * (k + 1));
    for (let n = 0; n < NEIGHBOURS; n++) glances[n] = own[n] < 0 ? Infinity : costs.cost(i, own[n], GLANCE);
    for (let n = 0; n < FAVOURITES; n++) {
      const best = glances.indexOf(Math.min(...glances));
      if (!Number.isFinite(glances[best])) break;
      glances[best] = Infinity;
      partners[FAVOURITES * k + n] = own[best];
      found[FAVOURITES * k + n] = costs.cost(i, own[best]);
    }
  }
}
