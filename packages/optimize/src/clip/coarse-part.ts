import type { GaussianCloud } from '@gaussian-splat/core';
import { packedOrder } from '@gaussian-splat/renderer/tools';
import type { Tracks } from './tracks.js';

/** Minimum number of neighboring splats for each splat of the coarse part. */
const COARSE_RUN = 8;
/** Approximate maximum number of splats of a coarse part. At 30 bytes each, it arrives within 1.7 s at 2 Mbit/s. */
const MAX_COARSE = 12_000;

/**
 * Divides tracks into a coarse part with splats from all regions of the scene, and the rest.
 * @param cloud Splats of the tracks.
 * @param tracks Undefined for splats that never change.
 * @returns Indices of the tracks of each part that is not empty.
 */
export function coarseAndRest(cloud: GaussianCloud, tracks?: Tracks): readonly Uint32Array[] {
  const order = packedOrder(cloud);
  const weightOf = (i: number): number => {
    const [a, b, c] = cloud.scales.subarray(3 * i, 3 * i + 3);
    const area = Math.max(a * b, b * c, c * a);
    if (!tracks) return cloud.opacities[i] * area;
    const { lives, frames } = tracks;
    return (cloud.opacities[i] * area * (lives.end[i] - lives.first[i])) / frames.length;
  };
  const coarse: number[] = [];
  const rest: number[] = [];
  const runLength = Math.max(COARSE_RUN, Math.ceil(order.length / MAX_COARSE));
  for (let at = 0; at < order.length; at += runLength) {
    const run = [...order.subarray(at, at + runLength)];
    const weights = run.map(weightOf);
    const best = weights.indexOf(Math.max(...weights));
    run.forEach((i, k) => (k === best ? coarse : rest).push(i));
  }
  return [coarse, rest].filter(({ length }) => length > 0).map((own) => Uint32Array.from(own));
}
