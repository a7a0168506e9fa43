import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { scaleRotationFactor } from '../pack/factor.js';

/** Numbers of the lower triangular root of a covariance: xx, yx, yy, zx, zy, zz. */
export const FACTOR_NUMBERS = 6;

/** One level of detail of a scene, splats in an order in which neighbours in space are mostly neighbours. */
export interface SplatLevel {
  readonly count: number;
  /** [N, 3] world units, relative to the origin of the cloud. */
  readonly positions: Float32Array;
  /** [N, 6] lower triangular roots of the covariances, world units. */
  readonly factors: Float32Array;
  /** [N] opacities; those of merged splats may exceed 1 (see `opacityOfCover`). */
  readonly opacities: Float32Array;
  /** Spherical harmonics, {@link shNumbers} of each splat. */
  readonly sh: Float32Array;
  /** Where in `sh`, in splats, those of each splat lie; undefined if in order. */
  readonly shOrder?: Uint32Array;
  readonly shDegree: ShDegree;
  /** What the renderer adds to screen variances without taking it from opacities, in px²: see `mergePair`. */
  readonly dilation: number;
  /** [N] mean square displacement of what each splat stands for, in world units². */
  readonly spreads: Float32Array;
}

/** Spherical-harmonics numbers of one splat. */
export const shNumbers = (degree: ShDegree): number => 3 * shCoefficientCount(degree);

/** Chunks of a level. */
export const chunksOf = (splats: number): number => Math.ceil(splats / constants.CULL_GROUP);

/** Room for a level of merged splats. */
export function emptyLevel(count: number, { shDegree, dilation }: SplatLevel): SplatLevel {
  return {
    count,
    positions: new Float32Array(3 * count),
    factors: new Float32Array(FACTOR_NUMBERS * count),
    opacities: new Float32Array(count),
    sh: new Float32Array(shNumbers(shDegree) * count),
    shDegree,
    dilation,
    spreads: new Float32Array(count),
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
    for (let axis = 0; axis < 3; axis++) positions[3 * k + axis] = cloud.positions[3 * i + axis];
    scaleRotationFactor(cloud, i, factor);
    factors.set(factor, FACTOR_NUMBERS * k);
    opacities[k] = Math.min(1, Math.max(0, cloud.opacities[i]));
  }
  const { sh, shDegree, antialiased } = cloud;
  const dilation = antialiased ? 0 : constants.DILATION;
  const spreads = new Float32Array(count);
  return { count, positions, factors, opacities, sh, shOrder: kept, shDegree, dilation, spreads };
}
