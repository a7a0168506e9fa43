import { detailAllow, detailCount } from '../generated/budget-shaders.js';
import { constants } from '../generated/shaders.js';
import { Stage } from './stage.js';

/** Finds the error threshold on screen that keeps a frame within its splat budget. */
export interface DetailBudget {
  /** Counts one block; `lod_counts` must be 0 before the first. */
  readonly count: Stage<typeof detailCount>;
  /** Runs after the last block. */
  readonly threshold: Stage<typeof detailAllow>;
}

export const detailBudgetOn = (device: GPUDevice): DetailBudget => ({
  count: new Stage(device, detailCount, constants.CULL_GROUP * constants.DETAIL_THREADS),
  threshold: new Stage(device, detailAllow),
});
