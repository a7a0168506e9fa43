import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { scaleRotationFactor } from '../pack/factor.js';

/** Number of entries of the lower triangular root of a covariance: xx, yx, yy, zx, zy, zz. */
export const FACTOR_NUMBERS = 6;

/** Splats that are merged to build a coarser level. Their order keeps neighbors in space mostly adjacent. */
export interface LevelSource {
  readonly count: number;
  /** [N, 3] positions in world units, relative to the origin of the cloud */
  readonly positions: Float32Array;
  /** [N, 6] lower triangular roots of the covariances, world units. */
  readonly factors: Float32Array;
  /** [N] opacities; those of merged splats may exceed 1 (see `opacityOfCover`). */
  readonly opacities: Float32Array;
  /** [N] mean squared displacement, in world units², of the original splats that each splat represents */
  readonly spreads: Float32Array;
  readonly shDegree: ShDegree;
  /**
   * Variance in px² that the renderer adds to splats on the screen without compensating their opacities: see
   * `mergePair`.
   */
  readonly dilation: number;
  /**
   * Writes the spherical harmonics of `count` splats, from index `first` on, to the beginning of `out`: {@link
   * shNumbers} for each splat.
   */
  readonly readSh: (first: number, count: number, out: Float32Array) => void;
}

/** One level of detail of a scene. */
export interface SplatLevel extends LevelSource {
  /** [N, {@link shNumbers}] spherical harmonics */
  readonly sh: Float32Array;
  /** [N] index in `sh` of the harmonics of each splat; undefined if `sh` has the order of the splats. */
  readonly shOrder?: Uint32Array;
}

/** Returns the number of spherical harmonics coefficients of one splat, over all channels. */
export const shNumbers = (degree: ShDegree): number => 3 * shCoefficientCount(degree);

/** Returns the number of chunks for a number of splats. */
export const chunksOf = (splats: number): number => Math.ceil(splats / constants.CULL_GROUP);

/** Allocates a level of `count` merged splats; all values are 0. */
export function emptyLevel(
  count: number,
  { shDegree, dilation }: Pick<LevelSource, 'shDegree' | 'dilation'>,
): SplatLevel {
  const stride = shNumbers(shDegree);
  const sh = new Float32Array(stride * count);
  return {
    ...{ count, sh, shDegree, dilation },
    positions: new Float32Array(3 * count),
    factors: new Float32Array(FACTOR_NUMBERS * count),
    opacities: new Float32Array(count),
    spreads: new Float32Array(count),
    readSh: (first, some, out) => out.set(sh.subarray(stride * first, stride * (first + some))),
  };
}

/** Positions, covariance factors and opacities of some splats. */
export type SplatShapes = Pick<LevelSource, 'positions' | 'factors' | 'opacities'>;

const factor = new Float64Array(FACTOR_NUMBERS);

/** Writes the shapes of the splats `kept[from]` to `kept[end - 1]` of a cloud to the beginning of `out`. */
export function putShapes(cloud: GaussianCloud, kept: Uint32Array, from: number, end: number, out: SplatShapes): void {
  for (let at = from, k = 0; at < end; at++, k++) {
    const i = kept[at];
    out.positions[3 * k] = cloud.positions[3 * i];
    out.positions[3 * k + 1] = cloud.positions[3 * i + 1];
    out.positions[3 * k + 2] = cloud.positions[3 * i + 2];
    scaleRotationFactor(cloud, i, factor);
    for (let n = 0; n < FACTOR_NUMBERS; n++) out.factors[FACTOR_NUMBERS * k + n] = factor[n];
    out.opacities[k] = Math.min(1, Math.max(0, cloud.opacities[i]));
  }
}

/** Returns the finest level: the splats `kept` of a cloud, in that order. */
export function leafLevel(cloud: GaussianCloud, kept: Uint32Array): SplatLevel {
  const count = kept.length;
  const positions = new Float32Array(3 * count);
  const factors = new Float32Array(FACTOR_NUMBERS * count);
  const opacities = new Float32Array(count);
  putShapes(cloud, kept, 0, count, { positions, factors, opacities });
  const { sh, shDegree, antialiased, filterVariance = constants.DILATION } = cloud;
  const dilation = antialiased ? 0 : filterVariance;
  const spreads = new Float32Array(count);
  const readSh = gatherer(sh, shNumbers(shDegree), kept);
  return { count, positions, factors, opacities, sh, shOrder: kept, shDegree, dilation, spreads, readSh };
}

function gatherer(sh: Float32Array, stride: number, order: Uint32Array): LevelSource['readSh'] {
  return (first, count, out) => {
    for (let k = 0; k < count; k++) {
      const from = stride * order[first + k];
      for (let n = 0; n < stride; n++) out[stride * k + n] = sh[from + n];
    }
  };
}
