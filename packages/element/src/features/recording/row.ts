import type { FeatureRow } from '../../viewer/features.js';

/** Images and videos of the element. */
export const recording: FeatureRow = {
  what: 'the code for images',
  open: async () => ({ ...(await import('./capture-image.js')) }),
};
