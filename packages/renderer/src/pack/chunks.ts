import type { GaussianCloud } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { CHUNK_NUMBERS } from './words.js';

const { CULL_GROUP, ALPHA_MIN } = constants;

/** Reach of a splat from its center with an alpha of at least 1/255 along its longest axis, world units. */
export function reachOf({ scales, opacities }: Pick<GaussianCloud, 'scales' | 'opacities'>, i: number): number {
  const longest = Math.max(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]);
  return longest * Math.sqrt(2 * Math.log(Math.max(1, Math.min(1, opacities[i]) / ALPHA_MIN)));
}

/** Bounds of each run of 256 splats: the box of their centers, and their largest reach. */
export function boundChunks(cloud: GaussianCloud, kept: Uint32Array): Float32Array {
  const { positions } = cloud;
  const chunks = new Float32Array(CHUNK_NUMBERS * Math.ceil(kept.length / CULL_GROUP));
  for (let first = 0, at = 0; first < kept.length; first += CULL_GROUP, at += CHUNK_NUMBERS) {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    let reach = 0;
    for (const i of kept.subarray(first, first + CULL_GROUP)) {
      for (let axis = 0; axis < 3; axis++) {
        const x = positions[3 * i + axis];
        if (x < low[axis]) low[axis] = x;
        if (x > high[axis]) high[axis] = x;
      }
      reach = Math.max(reach, reachOf(cloud, i));
    }
    chunks.set([...low, reach, ...high, 0], at);
  }
  return chunks;
}
