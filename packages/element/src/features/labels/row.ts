import type { FeatureRow } from '../../viewer/features.js';

/**
 * Positions the labels of the page: children in slots named `hotspot-…`.
 *
 * @slot hotspot-* - A label of the page at the scene point in its `data-position`.
 * @cssproperty [--min-hotspot-opacity=0.25] - Opacity of hotspots that are hidden.
 * @cssproperty [--max-hotspot-opacity=1] - Opacity of visible hotspots.
 */
export const labels: FeatureRow = {
  what: 'the code of labels',
  children: ':scope>[slot^=hotspot-]',
  open: async (viewer) => {
    const { HotspotController } = await import('./hotspot-controller.js');
    const labels = new HotspotController(viewer);
    if (viewer.drawnFrom) labels.frameDrawn(viewer.drawnFrom);
    return labels;
  },
};
