import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { scaleRotationFactor } from '../pack/factor.js';

/** Entries of the lower triangular root of a covariance: xx, yx, yy, zx, zy, zz. */
export const FACTOR_NUMBERS = 6;

/** Source of a coarser level: splats in an order that keeps neighbors in space mostly adjacent. */
export interface LevelSource {
  readonly count: number;
  /** [N, 3] world units, relative to the origin of the cloud. */
  readonly positions: Float32Array;
  /** [N, 6] lower triangular roots of the covariances, world units. */
  readonly factors: Float32Array;
  /** [N] opacities; those of merged splats may exceed 1 (see `opacityOfCover`). */
  readonly opacities: Float32Array;
  /** [N] mean squared displacement of the splats that each splat represents, in world units². */
  readonly spreads: Float32Array;
  readonly shDegree: ShDegree;
  /** Variance in px² that the renderer adds on the screen without compensating opacities: see `mergePair`. */
  readonly dilation: number;
  /** Writes the harmonics of `count` splats from `first` on, {@link shNumbers} of each, to the start of `out`. */
  readonly readSh: (first: number, count: number, out: Float32Array) => void;
}

/** One level of detail of a scene. */
export interface SplatLevel extends LevelSource {
  /** Spherical harmonics, {@link shNumbers} of each splat. */
  readonly sh: Float32Array;
  /** Index in `sh`, in splats, of the harmonics of each splat; undefined if in order. */
  readonly shOrder?: Uint32Array;
}

/** Number of spherical harmonics coefficients of one splat, over all channels. */
export const shNumbers = (degree: ShDegree): number => 3 * shCoefficientCount(degree);

/** Number of chunks of a level. */
export const chunksOf = (splats: number): number => Math.ceil(splats / constants.CULL_GROUP);

/** Allocates a level of merged splats. */
export function emptyLevel(count: number, { shDegree, dilation }: LevelSource): SplatLevel {
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

/** The finest level: the splats `kept` of a cloud, in that order. */
export function leafLevel(cloud: GaussianCloud, kept: Uint32Array): SplatLevel {
  const count = kept.length;
  const positions = new Float32Array(3 * count);
  const factors = new Float32Array(FACTOR_NUMBERS * count);
  const opacities = new Float32Array(count);
  const factor = new Float64Array(FACTOR_NUMBERS);
  for (let k = 0; k < count; k++) {
    const i = kept[k];
    positions[3 * k] = cloud.positions[3 * i];
    positions[3 * k + 1] = cloud.positions[3 * i + 1];
    positions[3 * k + 2] = cloud.positions[3 * i + 2];
    scaleRotationFactor(cloud, i, factor);
    for (let n = 0; n < FACTOR_NUMBERS; n++) factors[FACTOR_NUMBERS * k + n] = factor[n];
    opacities[k] = Math.min(1, Math.max(0, cloud.opacities[i]));
  }
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
