import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { factors, project } from './project.js';

/** Count of numbers of a splat in each view. */
export const SEEN = 6;
/** Indices of the center (u, v) in px. */
export const [U, V] = [0, 1] as const;
/** Indices of the screen-space covariance in px², which includes the filter variance. */
export const [UU, UV, VV] = [2, 3, 4] as const;
/** Index of the opacity in the view, 0 for a splat outside the view. */
export const AMPLITUDE = 5;

/**
 * Projects splats into views.
 * @param seen [N, views, SEEN] array of zeros that receives the projections.
 * @returns `seen`
 */
export function seenSplats(cloud: GaussianCloud, views: readonly Camera[], seen: Float32Array): Float32Array {
  const roots = factors(cloud);
  views.forEach((camera, view) => {
    const { count, source, ellipses } = project(cloud, roots, camera);
    for (let k = 0; k < count; k++) {
      const [from, to] = [6 * k, SEEN * (views.length * source[k] + view)];
      const [xx, xy, yy] = [ellipses[from + 2], ellipses[from + 3], ellipses[from + 4]];
      const determinant = xx * yy - xy * xy;
      seen[to + U] = ellipses[from];
      seen[to + V] = ellipses[from + 1];
      seen[to + UU] = yy / determinant;
      seen[to + UV] = -xy / determinant;
      seen[to + VV] = xx / determinant;
      seen[to + AMPLITUDE] = ellipses[from + 5];
    }
  });
  return seen;
}
