import { shCoefficientCount, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { eyeOf, shBasis } from './colour.js';
import type { ContributionScorer } from './scorer.js';

/** What the splats of a cloud were seen to contribute. */
export interface Scores {
  /** [N] largest weight in any pixel of any view, 0..1. */
  readonly contribution: Float32Array;
  /**
   * For each degree d below the cloud's: [N] the mean squared error of the views' images if the splat keeps the coefficients up to d
   * and its constant one is set anew.
   */
  readonly colourError: readonly Float32Array[];
  /** For each degree d below the cloud's: [N, 3] the colour that is best added when the coefficients above d go. */
  readonly colourShift: readonly Float32Array[];
}

/** Sums over views, for one degree, e the energy: of e·Δ for each channel, and of e·Δ² of all channels. */
interface Sums {
  readonly shift: Float32Array;
  readonly squares: Float32Array;
}

/** Looks at a cloud from all views. */
export async function scoreSplats(
  cloud: GaussianCloud,
  views: readonly Camera[],
  scorer: ContributionScorer,
  signal?: AbortSignal,
): Promise<Scores> {
  const { count, shDegree } = cloud;
  const contribution = new Float32Array(count);
  const weights = new Float32Array(count);
  const sums: Sums[] = Array.from({ length: shDegree }, () => ({
    shift: new Float32Array(3 * count),
    squares: new Float32Array(count),
  }));
  for (const view of views) {
    signal?.throwIfAborted();
    const seen = await scorer(view);
    for (let i = 0; i < count; i++) if (seen.peak[i] > contribution[i]) contribution[i] = seen.peak[i];
    if (shDegree > 0) addView(cloud, view, seen.energy, weights, sums);
  }
  const colourError = sums.map(({ shift, squares }) =>
    squares.map((square, i) => Math.max(0, square - residue(shift, weights[i], i)) / (3 * views.length)),
  );
  const colourShift = sums.map(({ shift }) => shift.map((sum, k) => sum / Math.max(1e-20, weights[Math.floor(k / 3)])));
  return { contribution, colourError, colourShift };
}

/** What setting the constant coefficient anew takes off the sum of squares. */
function residue(shift: Float32Array, weight: number, i: number): number {
  if (weight === 0) return 0;
  return (shift[3 * i] ** 2 + shift[3 * i + 1] ** 2 + shift[3 * i + 2] ** 2) / weight;
}

/** Adds one view's energies, and the colours that go with the bands above each degree. */
function addView(
  { count, positions, origin, sh, shDegree }: GaussianCloud,
  view: Camera,
  energy: Float32Array,
  weights: Float32Array,
  sums: readonly Sums[],
): void {
  const numbers = shCoefficientCount(shDegree);
  const basis = new Float64Array(16);
  const eye = eyeOf(view);
  const lost = [0, 0, 0];
  for (let i = 0; i < count; i++) {
    const weight = energy[i];
    if (weight === 0) continue;
    const x = positions[3 * i] + origin[0] - eye[0];
    const y = positions[3 * i + 1] + origin[1] - eye[1];
    const z = positions[3 * i + 2] + origin[2] - eye[2];
    const norm = 1 / Math.sqrt(x * x + y * y + z * z);
    shBasis(shDegree, x * norm, y * norm, z * norm, basis);
    weights[i] += weight;
    lost.fill(0);
    for (let band = shDegree; band >= 1; band--) {
      for (let k = band * band; k < (band + 1) ** 2; k++) {
        const at = 3 * (i * numbers + k);
        for (let channel = 0; channel < 3; channel++) lost[channel] += basis[k] * sh[at + channel];
      }
      const { shift, squares } = sums[band - 1];
      for (let channel = 0; channel < 3; channel++) shift[3 * i + channel] += weight * lost[channel];
      squares[i] += weight * (lost[0] ** 2 + lost[1] ** 2 + lost[2] ** 2);
    }
  }
}
