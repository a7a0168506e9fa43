import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { MIN_LOOKS, UNSEEN_CONTRAST, type Scores } from '../../../packages/optimize/src/score.js';
import { ColorMoments } from './color-moments.js';
import type { ContributionScorer } from './scorer.js';

/** Looks at a cloud from all views. */
export async function scoreSplats(
  cloud: GaussianCloud,
  views: readonly Camera[],
  scorer: ContributionScorer,
  signal?: AbortSignal,
): Promise<Scores> {
  const { count } = cloud;
  const contribution = new Float32Array(count);
  const removalError = new Float32Array(count);
  const looks = new Uint16Array(count);
  const colors = new ColorMoments(cloud);
  for (const view of views) {
    signal?.throwIfAborted();
    const { peak, energy, removal } = await scorer(view);
    countLooks(cloud, view, looks);
    for (let i = 0; i < count; i++) {
      if (peak[i] > contribution[i]) contribution[i] = peak[i];
      const error = removal[i] + UNSEEN_CONTRAST * energy[i];
      if (error > removalError[i]) removalError[i] = error;
    }
    if (cloud.shDegree > 0) colors.add(view, energy);
  }
  colors.addPrior(looks);
  const lowered = colors.lowered();
  for (let i = 0; i < count; i++) {
    if (looks[i] >= MIN_LOOKS) continue;
    [contribution[i], removalError[i]] = [1, Infinity];
    for (const { error } of lowered) error[i] = Infinity;
  }
  return { contribution, removalError, lowered };
}

/** Counts the views in whose frame the center of each splat lies. */
function countLooks({ count, positions, origin }: GaussianCloud, view: Camera, looks: Uint16Array): void {
  const { worldToCamera: m, fx, fy, cx, cy, width, height, near } = view;
  for (let i = 0; i < count; i++) {
    const [x, y, z] = [
      positions[3 * i] + origin[0],
      positions[3 * i + 1] + origin[1],
      positions[3 * i + 2] + origin[2],
    ];
    const depth = m[8] * x + m[9] * y + m[10] * z + m[11];
    if (depth < near) continue;
    const u = (fx * (m[0] * x + m[1] * y + m[2] * z + m[3])) / depth + cx;
    const v = (fy * (m[4] * x + m[5] * y + m[6] * z + m[7])) / depth + cy;
    if (u >= 0 && u < width && v >= 0 && v < height) looks[i]++;
  }
}
