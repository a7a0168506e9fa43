import type { GaussianCloud } from '@gaussian-splat/core';
import { packedOrder } from '@gaussian-splat/renderer/tools';
import type { Tracks } from './tracks.js';

/** One of at least this many neighboring splats is in the coarse part, so that every region is represented. */
const COARSE_RUN = 8;
/** Splats of the coarse part at most, approximately: at 30 bytes each the first frame arrives within 1.7 s at 2 Mbit/s. */
const MAX_COARSE = 12_000;

/**
 * Divides tracks into the coarse part, which gives an image on its own, and the rest.
 * @param cloud Their splats.
 */
export function coarseAndRest(cloud: GaussianCloud, { lives, frames }: Tracks): readonly Uint32Array[] {
  const order = packedOrder(cloud);
  const weightOf = (i: number): number => {
    const [a, b, c] = cloud.scales.subarray(3 * i, 3 * i + 3);
    return (cloud.opacities[i] * Math.max(a * b, b * c, c * a) * (lives.end[i] - lives.first[i])) / frames.length;
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
