import { detailAllow, detailCount } from '../generated/budget-shaders.js';
import { constants } from '../generated/shaders.js';
import { Stage } from './stage.js';

/** How far chunks may be off on screen so that a frame looks at no more splats than it may. */
export interface DetailBudget {
  /** Counts a page; `detail_counts` must be 0 before the first. */
  readonly count: Stage<typeof detailCount>;
  /** Follows the last page. */
  readonly allow: Stage<typeof detailAllow>;
}

export const detailBudgetOn = (device: GPUDevice): DetailBudget => ({
  count: new Stage(device, detailCount, constants.CULL_GROUP * constants.DETAIL_THREADS),
  allow: new Stage(device, detailAllow),
});
