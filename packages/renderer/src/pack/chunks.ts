import type { GaussianCloud } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { CHUNK_NUMBERS } from './words.js';

const { CULL_GROUP, ALPHA_MIN } = constants;

/** Upper limit of the reach of a splat as a factor of its longest axis. */
const OPAQUE_REACH = 1.0001 * Math.sqrt(2 * Math.log(1 / ALPHA_MIN));

/**
 * Returns the distance in world units from the center of a splat, along its longest axis, at which its alpha falls
 * below 1/255.
 */
export function reachOf({ scales, opacities }: Pick<GaussianCloud, 'scales' | 'opacities'>, i: number): number {
  const longest = Math.max(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]);
  return longest * Math.sqrt(2 * Math.log(Math.max(1, Math.min(1, opacities[i]) / ALPHA_MIN)));
}

/** Bounds of each run of 256 splats of a cloud. @param kept indices of the splats */
export function boundChunks(cloud: GaussianCloud, kept: Uint32Array): Float32Array {
  const { scales } = cloud;
  // Splats that reach no farther than the farthest before them need no logarithm.
  const reachAt = (i: number, reach: number): number =>
    OPAQUE_REACH * Math.max(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]) < reach ? reach : reachOf(cloud, i);
  return boundRuns(kept.length, cloud.positions, reachAt, kept);
}

/**
 * Returns one `Chunk` row for each run of 256 splats: the box of their centers and their largest reach, in world units.
 * @param reachAt Returns the reach of a splat, or at most `reach`, the largest reach before it.
 * @param kept indices of the splats; all `count` splats in their order if absent
 */
export function boundRuns(
  count: number,
  positions: Float32Array,
  reachAt: (i: number, reach: number) => number,
  kept?: Uint32Array,
): Float32Array {
  const chunks = new Float32Array(CHUNK_NUMBERS * Math.ceil(count / CULL_GROUP));
  for (let first = 0, at = 0; first < count; first += CULL_GROUP, at += CHUNK_NUMBERS) {
    let [lowX, lowY, lowZ, highX, highY, highZ] = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
    let reach = 0;
    for (let k = first; k < Math.min(count, first + CULL_GROUP); k++) {
      const i = kept ? kept[k] : k;
      const [x, y, z] = [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];
      if (x < lowX) lowX = x;
      if (x > highX) highX = x;
      if (y < lowY) lowY = y;
      if (y > highY) highY = y;
      if (z < lowZ) lowZ = z;
      if (z > highZ) highZ = z;
      reach = Math.max(reach, reachAt(i, reach));
    }
    chunks.set([lowX, lowY, lowZ, reach, highX, highY, highZ, 0], at);
  }
  return chunks;
}
