import { shCoefficientCount, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { eyeOf, shBasis } from './colour.js';
import type { ContributionScorer } from './scorer.js';

/** What the splats of a cloud were seen to contribute. */
export interface Scores {
  /** [N] largest weight in any pixel of any view, 0..1; 1 for splats that too few views looked at to judge them. */
  readonly contribution: Float32Array;
  /**
   * For each degree d below the cloud's: [N] the mean squared error of the views' images if the splat keeps the coefficients up to d
   * and its constant one is set anew.
   */
  readonly colourError: readonly Float32Array[];
  /** For each degree d below the cloud's: [N, 3] the colour that is best added when the coefficients above d go. */
  readonly colourShift: readonly Float32Array[];
}

/** A splat that fewer views looked at is kept: another view may show it in full. */
const MIN_LOOKS = 3;

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
  const looks = new Uint16Array(count);
  const sums: Sums[] = Array.from({ length: shDegree }, () => ({
    shift: new Float32Array(3 * count),
    squares: new Float32Array(count),
  }));
  for (const view of views) {
    signal?.throwIfAborted();
    const seen = await scorer(view);
    countLooks(cloud, view, looks);
    for (let i = 0; i < count; i++) if (seen.peak[i] > contribution[i]) contribution[i] = seen.peak[i];
    if (shDegree > 0) addView(cloud, view, seen.energy, weights, sums);
  }
  for (let i = 0; i < count; i++) if (looks[i] < MIN_LOOKS) contribution[i] = 1;
  sums.forEach((sum, degree) => addPrior(cloud, degree, sum, weights, looks));
  const total = weights.map((weight, i) => weight + priorWeight(weight, looks[i]));
  const colourError = sums.map(({ shift, squares }) =>
    squares.map((square, i) => Math.max(0, square - residue(shift, total[i], i)) / (3 * views.length)),
  );
  const colourShift = sums.map(({ shift }) => shift.map((sum, k) => sum / Math.max(1e-20, total[Math.floor(k / 3)])));
  return { contribution, colourError, colourShift };
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

/** A few views know little of a colour that depends on the view: so many more are imagined, from everywhere. */
const PRIOR_VIEWS = 2;

const priorWeight = (weight: number, looks: number): number => (PRIOR_VIEWS * weight) / Math.max(1, looks);

/** Adds the views that are imagined: over all directions, the bands above a degree average to nothing, and their squares to this. */
function addPrior(
  { count, sh, shDegree }: GaussianCloud,
  degree: number,
  { squares }: Sums,
  weights: Float32Array,
  looks: Uint16Array,
): void {
  const numbers = 3 * shCoefficientCount(shDegree);
  const first = 3 * (degree + 1) ** 2;
  for (let i = 0; i < count; i++) {
    let power = 0;
    for (let k = first; k < numbers; k++) power += sh[numbers * i + k] ** 2;
    squares[i] += (priorWeight(weights[i], looks[i]) * power) / (4 * Math.PI);
  }
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
