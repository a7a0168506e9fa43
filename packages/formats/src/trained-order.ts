import type { TrainedOrder } from '@gaussian-splat/core';

/** Returns a trained order by the name that our files give it; undefined for other values. */
export const trainedOrder = (name: unknown): TrainedOrder | undefined =>
  name === 'pixel' || name === 'distance' ? name : undefined;
