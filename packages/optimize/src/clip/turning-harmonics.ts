import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { HarmonicsTurner } from '@gaussian-splat/formats';
import { turnBetween } from './curves.js';
import type { TrackedSplats } from './track-changes.js';
import type { Tracks } from './tracks.js';

/** Approximate number of compared splats of a frame, and of compared frames. */
const [SPLATS, FRAMES] = [2000, 8];

/**
 * Returns whether the spherical harmonics of frames are nearer to those of a cloud if these turn with the change of
 * rotation of each splat. The squared difference of coefficients is the mean squared difference of colors over all
 * directions.
 */
export function harmonicsTurn(tracks: Tracks, { cloud, placeOf }: TrackedSplats): boolean {
  if (cloud.shDegree === 0) return false;
  const numbers = 3 * shCoefficientCount(cloud.shDegree);
  const turner = new HarmonicsTurner(cloud.shDegree);
  const turn = new Float64Array(4);
  let [turned, kept] = [0, 0];
  const stride = Math.max(1, Math.floor(tracks.frames.length / FRAMES));
  for (let f = stride - 1; f < tracks.frames.length; f += stride) {
    const frame = tracks.frames[f];
    for (let i = 0; i < frame.count; i += Math.max(1, Math.floor(frame.count / SPLATS))) {
      const place = placeOf[tracks.of[f][i]];
      if (place < 0) continue;
      turnBetween(cloud, place, frame, i, turn);
      const still = cloud.sh.subarray(numbers * place, numbers * (place + 1));
      const moved = still.slice();
      turner.turn(moved, 0, [turn[0], turn[1], turn[2], turn[3]]);
      const weight = importance(frame, i);
      for (let k = 3; k < numbers; k++) {
        const seen = frame.sh[numbers * i + k];
        turned += weight * (seen - moved[k]) ** 2;
        kept += weight * (seen - still[k]) ** 2;
      }
    }
  }
  return turned < kept;
}

function importance({ opacities, scales }: GaussianCloud, i: number): number {
  const [a, b, c] = scales.subarray(3 * i, 3 * i + 3);
  return opacities[i] ** 2 * Math.max(a * b, b * c, c * a);
}
