import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { factors, project } from './project.js';

/** Numbers of a splat in a view. */
export const SEEN = 6;
/** Centre, px. */
export const [U, V] = [0, 1] as const;
/** Covariance on the screen, the dilation in it, px². */
export const [UU, UV, VV] = [2, 3, 4] as const;
/** Opacity on the screen; 0 for a splat that is not in the view. */
export const AMPLITUDE = 5;

/** What views see of splats, put into zeros. @param seen [N, views, SEEN], rows of a splat next to one another @returns `seen` */
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
