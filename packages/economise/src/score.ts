import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { ColourMoments, type LoweredColours } from './colour-moments.js';
import type { ContributionScorer } from './scorer.js';

/** What the splats of a cloud were seen to contribute. */
export interface Ranking {
  /** [N] largest weight in any pixel of any view, 0..1; 1 for splats that too few views looked at to judge them. */
  readonly contribution: Float32Array;
  /** [N] the largest mean squared error of any view's image if this splat alone goes, peak 1; Infinity for splats that too few views looked at. */
  readonly removalError: Float32Array;
}

/** A ranking, and what splats look like with fewer bands of colour. */
export interface Scores extends Ranking {
  /** The colours at each degree below the cloud's. */
  readonly lowered: readonly LoweredColours[];
}

/** A splat that fewer views looked at is kept, with all bands of its colour: another view may show it in full. */
export const MIN_LOOKS = 3;

/**
 * What lies behind a splat differs from it by the root of this, in other views, besides what it does in those that were looked at: much of what goes
 * goes together with what lay behind it, and then something else is seen.
 */
export const UNSEEN_CONTRAST = 0.1;

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
  const colours = new ColourMoments(cloud);
  for (const view of views) {
    signal?.throwIfAborted();
    const { peak, energy, removal } = await scorer(view);
    countLooks(cloud, view, looks);
    for (let i = 0; i < count; i++) {
      if (peak[i] > contribution[i]) contribution[i] = peak[i];
      const error = removal[i] + UNSEEN_CONTRAST * energy[i];
      if (error > removalError[i]) removalError[i] = error;
    }
    if (cloud.shDegree > 0) colours.add(view, energy);
  }
  colours.addPrior(looks);
  const lowered = colours.lowered();
  for (let i = 0; i < count; i++) {
    if (looks[i] >= MIN_LOOKS) continue;
    [contribution[i], removalError[i]] = [1, Infinity];
    for (const { error } of lowered) error[i] = Infinity;
  }
  return { contribution, removalError, lowered };
}

/** Counts the views in whose frame the centre of each splat lies. */
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
