import { detailAllow, detailCount } from '../generated/budget-shaders.js';
import { constants } from '../generated/shaders.js';
import { Stage } from './stage.js';

/** Stages that find the error threshold in pixels which keeps a frame within its splat budget. */
export interface DetailBudget {
  /** Counts the splats of one block; `detail_counts` must be 0 before the first block. */
  readonly count: Stage<typeof detailCount>;
  /** Finds the threshold; runs after the last block. */
  readonly threshold: Stage<typeof detailAllow>;
}

export const detailBudgetOn = (device: GPUDevice): DetailBudget => ({
  count: new Stage(device, detailCount, constants.CULL_GROUP * constants.DETAIL_THREADS),
  threshold: new Stage(device, detailAllow),
});
