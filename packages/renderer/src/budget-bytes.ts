import { bytesOf, PAIRS_PER_BUDGETED } from './capacity.js';

/** Returns the bytes of GPU memory that frames reserve for a splat budget of streamed scenes, at most. */
export const budgetBytes = (splats: number): number => bytesOf({ visible: splats, pairs: PAIRS_PER_BUDGETED * splats });
