/** The sort on the CPU, and the plan that the GPU's needs. */
import { constants, layouts } from '@gaussian-splat/renderer/stages';

/** Indices of the keys in ascending order, equal keys in the order they came. */
export const stableOrder = (keys: Uint32Array): Uint32Array =>
  Uint32Array.from(keys.keys()).sort((a, b) => keys[a] - keys[b] || a - b);

/** A plan for `count` keys, as the plan stage writes it. */
export function planFor(count: number): Uint32Array {
  const plan = new Uint32Array((layouts.Plan.size + layouts.PagePlan.size) / 4);
  const blocks = Math.ceil(count / constants.SORT_BLOCK);
  const { fields } = layouts.Plan;
  plan[fields.visible.offset / 4] = count;
  plan[fields.sort_blocks.offset / 4] = blocks;
  return plan;
}
