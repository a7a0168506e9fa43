import { GaussianSplatError } from './errors.js';
import type { Vector3 } from './vector.js';

/** Degree of the spherical harmonics of a cloud. Degree d has (d + 1)² coefficients for each color channel. */
export type ShDegree = 0 | 1 | 2 | 3;

/** Number of spherical-harmonics coefficients for each color channel: (d + 1)². */
export function shCoefficientCount(degree: ShDegree): 1 | 4 | 9 | 16 {
  return ((degree + 1) * (degree + 1)) as 1 | 4 | 9 | 16;
}

/**
 * The screen-space low-pass filter of a scene's training: `classic` adds 0.3 px² to the variance of each splat,
 * `antialiased` also compensates its opacity for that (the options of that name in gsplat and INRIA's code), and `mip`
 * adds 0.1 px² and compensates (Mip-Splatting, Brush's mip mode).
 */
export type SplatFilter = 'classic' | 'antialiased' | 'mip';

/** Parameters of a filter. */
export interface FilterRule {
  /** Whether opacities are compensated for the added variance. */
  readonly antialiased: boolean;
  /** Added variance in px²; undefined is the classic 0.3. */
  readonly filterVariance?: number | undefined;
}

export const SPLAT_FILTERS: Readonly<Record<SplatFilter, FilterRule>> = {
  classic: { antialiased: false, filterVariance: undefined },
  antialiased: { antialiased: true, filterVariance: undefined },
  mip: { antialiased: true, filterVariance: 0.1 },
};

/** Splats `first` to `first + count` of a cloud: one level of detail of a node of the scene; level 0 is the finest. */
export interface LevelRun {
  readonly first: number;
  readonly count: number;
  readonly node: number;
  readonly level: number;
}

/** Metadata of a file. */
export interface CloudHints {
  /** Unit vector that points up in the coordinates of the cloud. */
  readonly up?: Vector3 | undefined;
  /** Whether the file declares no coordinate system, so that up was inferred from its writer. */
  readonly isUpAssumed?: boolean;
  /** The tool that wrote the file, as the file names it. */
  readonly generator?: string;
  /** `pixel`: the scene was trained with per-pixel order, as in StopThePop. */
  readonly order?: 'pixel';
  /** Whether the file also has triangles, which a cloud cannot hold. */
  readonly meshes?: boolean;
}

/**
 * Gaussians on the CPU, activated and ready to draw; every format is read into this structure.
 *
 * Coordinates are those of the trainers and of INRIA's PLY files, which are OpenCV's for an upright capture (x right, y
 * down, z forward). Readers of formats with other coordinates convert them.
 */
export interface GaussianCloud {
  /** Number of Gaussians N. */
  readonly count: number;
  /** World position, in float64, of the local point (0, 0, 0) of {@link positions}. */
  readonly origin: Vector3;
  /** [N, 3] centers in world units, relative to {@link origin}. */
  readonly positions: Float32Array;
  /** [N, 3] standard deviations along the local axes in world units, linear (not log). */
  readonly scales: Float32Array;
  /** [N, 4] unit quaternions in the order (w, x, y, z), local axes to world. */
  readonly rotations: Float32Array;
  /** [N] opacities in 0..1, linear (not logit). */
  readonly opacities: Float32Array;
  /**
   * [N, (d+1)², 3] spherical-harmonics coefficients, red, green and blue innermost. Color = 0.5 + Σ c·Y(direction),
   * sRGB-encoded; the first coefficient is the constant one ("DC").
   */
  readonly sh: Float32Array;
  readonly shDegree: ShDegree;
  /** Whether the scene was trained with opacity compensation for the screen-space dilation (Mip-Splatting style). */
  readonly antialiased: boolean;
  /**
   * Variance in px² of the screen-space low-pass filter of training. Undefined: 0.3, as in INRIA's and gsplat's
   * trainers, with and without compensation; Mip-Splatting and Brush's mip mode use 0.1.
   */
  readonly filterVariance?: number | undefined;
  /** Metadata of the file. */
  readonly hints?: CloudHints | undefined;
  /**
   * Only for a file with its own levels of detail: all splats are in runs, and one run of each node is to be drawn.
   * Undefined: all splats are drawn.
   */
  readonly levelRuns?: readonly LevelRun[];
  /** Number of splats of the source that were dropped because of an unusable value; see {@link keepUsable}. */
  readonly droppedCount: number;
  /**
   * Counts of the splats that {@link keepUsable} dropped for a scale below 0, for a zero rotation, for no extent, and
   * for values that are not finite or too large.
   */
  readonly faults?: readonly number[] | undefined;
  /** Messages about parts of the file that are not drawn, or may be misinterpreted. */
  readonly warnings?: readonly string[] | undefined;
}

/**
 * Upper limit of the standard deviation along a splat's longest axis, in world units: squared screen sizes must fit
 * float32. Below the lower limit a splat has no extent.
 */
export const MAX_SCALE = 1e12;
/**
 * Upper limit of the coordinates of a drawable splat, in world units: products of two stay far below the limit of
 * float32, the type of chunk bounds.
 */
export const MAX_POSITION = 1e18;
export const MIN_LONGEST_SCALE = 1e-12;

/** Throws `argument/cloud` unless the arrays of a cloud have the lengths that `count` and `shDegree` require. */
export function validateCloud(cloud: GaussianCloud): void {
  const { count, shDegree } = cloud;
  const fail = (where: string, expected: string, found: string): never => {
    throw new GaussianSplatError('argument/cloud', {
      where: `GaussianCloud.${where}`,
      expected,
      found,
      remedy: 'pass arrays whose lengths match count and shDegree',
    });
  };
  if (!Number.isInteger(count) || count < 0) fail('count', 'a non-negative integer', String(count));
  if (![0, 1, 2, 3].includes(shDegree)) fail('shDegree', '0, 1, 2 or 3', String(shDegree));
  const lengths = {
    positions: 3 * count,
    scales: 3 * count,
    rotations: 4 * count,
    opacities: count,
    sh: 3 * shCoefficientCount(shDegree) * count,
  };
  for (const [name, length] of Object.entries(lengths)) {
    const array = cloud[name as keyof typeof lengths];
    if (!(array instanceof Float32Array) || array.length !== length) {
      fail(name, `a Float32Array of ${length} numbers`, `${array?.constructor?.name} of ${array?.length}`);
    }
  }
}

/**
 * Whether splat `i` can be drawn: all numbers finite, no coordinate beyond {@link MAX_POSITION}, a non-zero rotation,
 * the longest standard deviation within {@link MIN_LONGEST_SCALE}..{@link MAX_SCALE} and none negative. Single axes may
 * be 0, as in flat discs and needles. The shader `cull.wgsl` applies the same rule to buffers that the CPU never reads.
 */
export function isUsable(cloud: GaussianCloud, i: number): boolean {
  const { positions, scales, rotations, opacities, sh, shDegree } = cloud;
  const shLength = 3 * shCoefficientCount(shDegree);
  // A sum is finite only if every term is: infinities of both signs add up to NaN. sh is the longest array, so this is
  // the inner loop of loading, and a single sum would wait for each of its additions.
  let red = 0;
  let green = 0;
  let blue = 0;
  for (let k = shLength * i; k < shLength * (i + 1); k += 3) {
    red += sh[k];
    green += sh[k + 1];
    blue += sh[k + 2];
  }
  if (!Number.isFinite(opacities[i] + red + green + blue)) return false;
  for (let k = 3 * i; k < 3 * i + 3; k++) if (!(Math.abs(positions[k]) <= MAX_POSITION)) return false;
  const norm = squaredNorm(rotations, 4 * i);
  if (!(norm > 0 && Number.isFinite(norm))) return false;
  const a = scales[3 * i];
  const b = scales[3 * i + 1];
  const c = scales[3 * i + 2];
  if (!(a >= 0 && b >= 0 && c >= 0)) return false;
  const longest = Math.max(a, b, c);
  return longest >= MIN_LONGEST_SCALE && longest <= MAX_SCALE;
}

/**
 * Normalizes rotations and drops the splats that {@link isUsable} rejects, counting them in `droppedCount`. Works in
 * place on the arrays of `cloud` (which must not be used afterwards) and keeps the order of the rest.
 */
export function keepUsable(cloud: GaussianCloud): GaussianCloud {
  const { count, positions, scales, rotations, opacities, sh, shDegree } = cloud;
  const shLength = 3 * shCoefficientCount(shDegree);
  let kept = 0;
  const runs = cloud.levelRuns?.map(({ node, level }) => ({ first: 0, count: 0, node, level }));
  let run = 0;
  const faults = [...(cloud.faults ?? [0, 0, 0, 0])];
  for (let i = 0; i < count; i++) {
    if (!isUsable(cloud, i)) {
      faults[faultOf(cloud, i)]++;
      continue;
    }
    if (runs) {
      while (i >= cloud.levelRuns![run].first + cloud.levelRuns![run].count) runs[++run].first = kept;
      runs[run].count++;
    }
    if (kept !== i) {
      positions.copyWithin(3 * kept, 3 * i, 3 * i + 3);
      scales.copyWithin(3 * kept, 3 * i, 3 * i + 3);
      rotations.copyWithin(4 * kept, 4 * i, 4 * i + 4);
      opacities[kept] = opacities[i];
      sh.copyWithin(shLength * kept, shLength * i, shLength * (i + 1));
    }
    normalizeQuaternion(rotations, 4 * kept);
    opacities[kept] = Math.min(1, Math.max(0, opacities[kept]));
    kept++;
  }
  return {
    ...cloud,
    count: kept,
    positions: positions.subarray(0, 3 * kept),
    scales: scales.subarray(0, 3 * kept),
    rotations: rotations.subarray(0, 4 * kept),
    opacities: opacities.subarray(0, kept),
    sh: sh.subarray(0, shLength * kept),
    ...(runs && { levelRuns: runs }),
    ...(kept < count && { faults }),
    droppedCount: cloud.droppedCount + count - kept,
  };
}

/** Reason that a splat cannot be drawn, as an index of {@link GaussianCloud.faults}. */
function faultOf({ scales, rotations }: GaussianCloud, i: number): number {
  const axes = scales.subarray(3 * i, 3 * i + 3);
  if (Math.min(...axes) < 0) return 0;
  if (squaredNorm(rotations, 4 * i) === 0) return 1;
  return Math.max(...axes) < MIN_LONGEST_SCALE ? 2 : 3;
}

function normalizeQuaternion(rotations: Float32Array, at: number): void {
  const scale = 1 / Math.sqrt(squaredNorm(rotations, at));
  for (let k = at; k < at + 4; k++) rotations[k] *= scale;
}

/** Squares of float32 numbers neither overflow nor underflow in float64. */
function squaredNorm(rotations: Float32Array, at: number): number {
  const w = rotations[at];
  const x = rotations[at + 1];
  const y = rotations[at + 2];
  const z = rotations[at + 3];
  return w * w + x * x + y * y + z * z;
}
