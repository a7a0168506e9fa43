import type { Credits } from './credits.js';
import { GaussianSplatError } from './errors.js';
import type { Vector3 } from './vector.js';

/** Degree of the spherical harmonics of a cloud. Degree d has (d + 1)² coefficients for each color channel. */
export type ShDegree = 0 | 1 | 2 | 3;

/** Returns the number of spherical-harmonics coefficients for each color channel: (d + 1)². */
export function shCoefficientCount(degree: ShDegree): 1 | 4 | 9 | 16 {
  return ((degree + 1) * (degree + 1)) as 1 | 4 | 9 | 16;
}

/**
 * Screen-space low-pass filter in the training of a scene. `classic` adds 0.3 px² to the variance of each splat.
 * `antialiased` also compensates its opacity for the added variance (options of this name in gsplat and INRIA's code).
 * `mip` adds 0.1 px² and compensates (Mip-Splatting, Brush's mip mode).
 */
export type SplatFilter = 'classic' | 'antialiased' | 'mip';

/** Screen-space low-pass filter of a scene in training. */
export interface FilterRule {
  /** Whether training compensated opacities for the variance that the filter adds. The renderer then does so, too. */
  readonly antialiased: boolean;
  /**
   * Variance in px² of the filter. Undefined: 0.3, as in INRIA's and gsplat's trainers, with and without compensation.
   * Mip-Splatting and Brush's mip mode use 0.1.
   */
  readonly filterVariance?: number | undefined;
}

/** Parameters of each {@link SplatFilter}. */
export const SPLAT_FILTERS: Readonly<Record<SplatFilter, FilterRule>> = {
  classic: { antialiased: false, filterVariance: undefined },
  antialiased: { antialiased: true, filterVariance: undefined },
  mip: { antialiased: true, filterVariance: 0.1 },
};

/**
 * A level of detail of one node of the scene: splats `first` to `first + count - 1` of a cloud. Level 0 is the finest.
 */
export interface LevelRun {
  readonly first: number;
  readonly count: number;
  readonly node: number;
  readonly level: number;
}

/**
 * Sort order of splats in training, other than by the depth of their centers. `pixel`: per-pixel order, as in StopThePop;
 * `distance`: by the distance of their centers from the camera.
 */
export type TrainedOrder = 'pixel' | 'distance';

/** Metadata that a file declares, beside its Gaussians. */
export interface CloudHints {
  /** Unit vector that points up, in the coordinates of the cloud. */
  readonly up?: Vector3 | undefined;
  /** Whether {@link up} was inferred from the program that wrote the file, which declares no coordinate system. */
  readonly isUpAssumed?: boolean;
  /** Credits that the file declares. */
  readonly credits?: Credits | undefined;
  /** Name of the program that wrote the file, as stated in the file. */
  readonly generator?: string;
  /** Sort order of splats in training, if it is not that of their centers by depth. */
  readonly order?: TrainedOrder | undefined;
  /** Meters of a world unit, if the file declares it. */
  readonly metersPerUnit?: number | undefined;
  /** Number of splats that each enlarged splat of a preview represents; absent for other clouds. */
  readonly represented?: number;
  /** Whether the file also contains triangles, which are not part of a cloud. */
  readonly meshes?: boolean;
  /**
   * Recommended limits of a camera that orbits the scene: polar angles from up in radians, 0..π, and the minimum
   * distance to the target in world units. An undefined field sets no limit.
   */
  readonly orbit?: { readonly minPhi?: number; readonly maxPhi?: number; readonly minRadius?: number } | undefined;
}

/**
 * Gaussians on the CPU, activated and ready to draw. Readers convert every format to this structure.
 *
 * Coordinates are those of the trainers and of INRIA's PLY files: OpenCV's for an upright capture (x right, y down, z
 * forward). Readers convert formats with other coordinates.
 */
export interface GaussianCloud extends FilterRule {
  /** Number of Gaussians N. */
  readonly count: number;
  /** World position, in float64, of the local point (0, 0, 0) of {@link positions}. */
  readonly origin: Vector3;
  /** [N, 3] centers in world units, relative to {@link origin} */
  readonly positions: Float32Array;
  /** [N, 3] standard deviations along the local axes in world units, linear (not log) */
  readonly scales: Float32Array;
  /** [N, 4] unit quaternions in the order (w, x, y, z), from local axes to world */
  readonly rotations: Float32Array;
  /** [N] opacities in 0..1, linear (not logit) */
  readonly opacities: Float32Array;
  /**
   * [N, (d + 1)², 3] spherical-harmonics coefficients, with red, green and blue innermost. Color = 0.5 + Σ
   * c·Y(direction), sRGB-encoded. The first coefficient is the constant one ("DC").
   */
  readonly sh: Float32Array;
  readonly shDegree: ShDegree;
  /** Metadata of the file. */
  readonly hints?: CloudHints | undefined;
  /**
   * Levels of detail of a file that has its own. The runs contain every splat, and one run of each node must be drawn.
   * Undefined: all splats are drawn.
   */
  readonly levelRuns?: readonly LevelRun[];
  /** Number of splats of the source that were dropped because of an unusable value; see {@link keepUsable}. */
  readonly droppedCount: number;
  /** Counts of dropped splats: scale below 0, zero rotation, no extent, other values. See {@link keepUsable}. */
  readonly faults?: readonly number[] | undefined;
  /** Messages about parts of the file that are not drawn or may be misinterpreted. */
  readonly warnings?: readonly string[] | undefined;
}

/**
 * Upper limit of the standard deviation along a splat's longest axis, in world units, because squared screen sizes must
 * fit float32.
 */
const MAX_SCALE = 1e12;
/**
 * Upper limit of the coordinates of a drawable splat, in world units. Products of two coordinates are far below the
 * limit of float32, the type of chunk bounds.
 */
const MAX_POSITION = 1e18;
/** Lower limit of the longest standard deviation of a splat, world units. Smaller splats have no extent. */
const MIN_LONGEST_SCALE = 1e-12;

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
 * Whether splat `i` can be drawn. All its numbers must be finite, no coordinate may exceed {@link MAX_POSITION}, and
 * the rotation must not be zero. The longest standard deviation must be within {@link MIN_LONGEST_SCALE}..{@link
 * MAX_SCALE}, and none may be negative. Single axes may be 0, as in flat discs and needles. The shader `cull.wgsl`
 * applies the same rule to buffers that the CPU never reads.
 */
export function isUsable(cloud: GaussianCloud, i: number): boolean {
  const { positions, scales, rotations, opacities, sh, shDegree } = cloud;
  const shLength = 3 * shCoefficientCount(shDegree);
  // A sum is finite only if every term is finite: infinities of both signs add up to NaN. This is the inner loop of
  // loading, because sh is the longest array. Three sums are faster than one, which would wait for each addition.
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
 * Returns the cloud without the splats that {@link isUsable} rejects, which `droppedCount` and `faults` count.
 * Rotations are normalized, opacities are clamped to 0..1, and the order is kept. The result overwrites and shares the
 * arrays of `cloud`: do not use `cloud` afterwards.
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

/** Returns the reason that a splat cannot be drawn, as an index of {@link GaussianCloud.faults}. */
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

/** Returns the squared norm of a quaternion. Squares of float32 numbers neither overflow nor underflow in float64. */
function squaredNorm(rotations: Float32Array, at: number): number {
  const w = rotations[at];
  const x = rotations[at + 1];
  const y = rotations[at + 2];
  const z = rotations[at + 3];
  return w * w + x * x + y * y + z * z;
}
