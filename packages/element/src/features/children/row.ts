import type { FeatureRow } from '../../viewer/features.js';

/**
 * Shows the element's children `<splat-scene>` and `<splat-mesh>`.
 *
 * @csspart scene-button - The focusable area of a child with `interactive`.
 * @cssproperty [--scene-focus-color=highlight] - Color of the outline of a focused child with `interactive`.
 */
export const children: FeatureRow = {
  what: 'the code that shows several scenes',
  children: ':scope>splat-scene,:scope>splat-mesh',
  open: async (viewer) => {
    (await import('./compose.js')).compose(viewer);
    return {};
  },
};
