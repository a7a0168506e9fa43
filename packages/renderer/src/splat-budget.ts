import { bytesOf, PAIRS_PER_BUDGETED } from './capacity.js';
import { maxPairs } from './rasterizers/pair-buffers.js';
import { maxVisible } from './scratch.js';

/** Returns the bytes of GPU memory that frames reserve for a splat budget of streamed scenes, at most. */
export const budgetBytes = (splats: number): number => bytesOf({ visible: splats, pairs: PAIRS_PER_BUDGETED * splats });

/** Returns the maximum splat budget that the buffers of a device allow. */
export const maxSplatBudget = (device: GPUDevice): number =>
  Math.floor(Math.min(maxVisible(device), maxPairs(device) / PAIRS_PER_BUDGETED));
