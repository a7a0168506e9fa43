import type { GaussianCloud } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { CHUNK_NUMBERS } from './words.js';

const { CULL_GROUP, ALPHA_MIN } = constants;

/**
 * Returns the distance in world units from the center of a splat, along its longest axis, at which its alpha falls
 * below 1/255.
 */
export function reachOf({ scales, opacities }: Pick<GaussianCloud, 'scales' | 'opacities'>, i: number): number {
  const longest = Math.max(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]);
  return longest * Math.sqrt(2 * Math.log(Math.max(1, Math.min(1, opacities[i]) / ALPHA_MIN)));
}

/** Bounds of each run of 256 splats of a cloud. @param kept indices of the splats */
export const boundChunks = (cloud: GaussianCloud, kept: Uint32Array): Float32Array =>
  boundRuns(kept.length, cloud.positions, (i) => reachOf(cloud, i), kept);

/**
 * Returns one `Chunk` row for each run of 256 splats: the box of their centers and their largest reach, in world units.
 * @param kept indices of the splats; all `count` splats in their order if absent
 */
export function boundRuns(
  count: number,
  positions: Float32Array,
  reachAt: (i: number) => number,
  kept?: Uint32Array,
): Float32Array {
  const chunks = new Float32Array(CHUNK_NUMBERS * Math.ceil(count / CULL_GROUP));
  for (let first = 0, at = 0; first < count; first += CULL_GROUP, at += CHUNK_NUMBERS) {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    let reach = 0;
    for (let k = first; k < Math.min(count, first + CULL_GROUP); k++) {
      const i = kept ? kept[k] : k;
      for (let axis = 0; axis < 3; axis++) {
        const x = positions[3 * i + axis];
        if (x < low[axis]) low[axis] = x;
        if (x > high[axis]) high[axis] = x;
      }
      reach = Math.max(reach, reachAt(i));
    }
    chunks.set([...low, reach, ...high, 0], at);
  }
  return chunks;
}
