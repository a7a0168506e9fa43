import type { FeatureRow } from '../../viewer/features.js';

/** Draws an image before the page is printed. Its code is loaded with the first frame. */
export const print: FeatureRow = {
  what: 'the code for printing',
  by: ({ view }) => view.backend,
  open: async (viewer) => new (await import('./print-controller.js')).PrintController(viewer),
};
