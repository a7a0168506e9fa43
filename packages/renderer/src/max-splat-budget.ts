import { PAIRS_PER_BUDGETED } from './capacity.js';
import { maxPairs } from './rasterizers/pair-buffers.js';
import { maxVisible } from './scratch.js';

/** Returns the maximum splat budget that the buffers of a device allow. */
export const maxSplatBudget = (device: GPUDevice): number =>
  Math.floor(Math.min(maxVisible(device), maxPairs(device) / PAIRS_PER_BUDGETED));
