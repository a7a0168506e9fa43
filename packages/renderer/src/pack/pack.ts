import {
  GaussianSplatError,
  isUsable,
  validateCloud,
  type FilterRule,
  type GaussianCloud,
  type ShDegree,
  type Vector3,
} from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { boundChunks } from './chunks.js';
import { scaleRotationFactor } from './factor.js';
import { mortonOrder } from './morton.js';
import { recentered } from './recenter.js';
import { choosePrecision, noiseIn, packSh } from './sh.js';
import { GEOMETRY_WORDS, SH_PRECISION, type ShPrecision } from './words.js';

/** Options of {@link packGaussians}. */
export interface PackOptions {
  /**
   * Precision of the spherical harmonics. `int8` stores eight bits for each coefficient, a scale for each band of each
   * splat, and float16 for the mean color. `float16` takes nearly twice the memory. `auto`, the default, is `int8` if
   * its rounding error is below -62 dB per splat over all splats (75 dB PSNR and more in images), and below -50 dB in
   * each run of 256 neighbors. docs/decisions/0008 has the figures.
   */
  readonly sh?: ShPrecision | 'auto';
}

/** Properties of packed Gaussians without their data. */
export interface PackedHead extends FilterRule {
  readonly count: number;
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  readonly origin: Vector3;
  readonly droppedCount: number;
  /** Number of splats of the finest level, which precede all others; undefined without levels of detail. */
  readonly leafCount?: number;
}

/**
 * A cloud in the exact layout that the GPU reads. Plain data with transferable buffers, so that a worker can build it.
 */
export interface PackedGaussians extends PackedHead {
  /** [N, 8] words: `PackedGaussian` of shaders/shared/packed_gaussian.wgsl. */
  readonly geometry: Uint32Array;
  /** [N, {@link shWords}] words: see shaders/shared/sh.wgsl. */
  readonly sh: Uint32Array;
  /** [ceil(N / 256), 8] numbers: `Chunk` of shaders/cull_chunks.wgsl. */
  readonly chunks: Float32Array;
  /** [ceil(N / 256), 12] `ChunkDetail` of the shaders; undefined without levels of detail */
  readonly details?: Float32Array;
}

const { ALPHA_MIN } = constants;

const float = new Float32Array(1);
const bits = new Uint32Array(float.buffer);
float[0] = ALPHA_MIN;
/** Smallest 28-bit prefix of a float32 whose value is at least 1/255. */
const FIRST_VISIBLE = Math.ceil(bits[0] / 16);

/**
 * Packs a cloud for {@link GaussianBuffers.upload}. Neighbors in space become neighbors in memory. Each splat has 32
 * bytes of geometry (positions in float32, the root of the covariance to 14 significant bits, opacities to 20), and its
 * spherical harmonics. Splats that `isUsable` of core rejects are dropped and added to `droppedCount`. A cloud with
 * `levelRuns` is packed completely; `packLevelRuns` selects levels.
 * @throws GaussianSplatError `argument/cloud` if the arrays do not match `count` and `shDegree`; `argument/value` for
 * an unknown precision.
 */
export function packGaussians(given: GaussianCloud, options: PackOptions = {}): PackedGaussians {
  validateCloud(given);
  const cloud = recentered(given);
  const { shDegree, antialiased, filterVariance, origin } = cloud;
  const kept = packedOrder(cloud);
  const droppedCount = cloud.droppedCount + cloud.count - kept.length;
  const asked = options.sh ?? 'auto';
  if (asked !== 'auto' && !Object.hasOwn(SH_PRECISION, asked)) throw unknownPrecision(asked);
  const shPrecision = asked === 'auto' ? choosePrecision(noiseIn(cloud, kept), kept.length) : asked;
  const facts = { count: kept.length, shDegree, shPrecision, antialiased, filterVariance, origin, droppedCount };
  return { ...facts, ...packKept(cloud, kept, shPrecision) };
}

function unknownPrecision(found: unknown): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: 'PackOptions.sh',
    expected: ['auto', ...Object.keys(SH_PRECISION)].join(', '),
    found: String(found),
    remedy: 'leave the option out for the default, or choose one of the values expected',
  });
}

/** Packs the splats `kept` of a cloud, in the given order. */
export function packKept(
  cloud: GaussianCloud,
  kept: Uint32Array,
  shPrecision: ShPrecision,
): Pick<PackedGaussians, 'geometry' | 'sh' | 'chunks'> {
  return {
    geometry: packGeometry(cloud, kept),
    sh: packSh(cloud, kept, shPrecision),
    chunks: boundChunks(cloud, kept),
  };
}

/** Returns the index in the cloud of each packed splat. */
export function packedOrder(cloud: GaussianCloud): Uint32Array {
  return mortonOrder(cloud.positions, usableIndices(cloud));
}

/** Returns the indices of the drawable splats of a cloud, ascending. */
export function usableIndices(cloud: GaussianCloud): Uint32Array {
  const indices = new Uint32Array(cloud.count);
  let kept = 0;
  for (let i = 0; i < cloud.count; i++) if (isUsable(cloud, i)) indices[kept++] = i;
  return indices.subarray(0, kept);
}

/** Returns the geometry words of the splats `kept`, [kept, 8]. */
export function packGeometry(cloud: GaussianCloud, kept: Uint32Array): Uint32Array {
  const words = new Uint32Array(kept.length * GEOMETRY_WORDS);
  const floats = new Float32Array(words.buffer);
  const factor = new Float64Array(6);
  let at = 0;
  for (const i of kept) {
    floats[at] = cloud.positions[3 * i];
    floats[at + 1] = cloud.positions[3 * i + 1];
    floats[at + 2] = cloud.positions[3 * i + 2];
    scaleRotationFactor(cloud, i, factor);
    packShape(words, at + 3, factor, Math.min(1, cloud.opacities[i]));
    at += GEOMETRY_WORDS;
  }
  return words;
}

/** Returns the `count` highest bits of a float32, rounded to nearest. */
function highBits(value: number, count: number): number {
  float[0] = value;
  return (bits[0] + (1 << (31 - count))) >>> (32 - count);
}

/** Returns the 28 highest bits of an opacity. Rounding never crosses 1/255, because splats below it are not drawn. */
function opacityBits(opacity: number): number {
  const nearest = highBits(Math.max(0, opacity), 28);
  return opacity >= ALPHA_MIN ? Math.max(nearest, FIRST_VISIBLE) : Math.min(nearest, FIRST_VISIBLE - 1);
}

/**
 * Writes five words of a covariance factor and an opacity, which is above 1 only for merged splats. The upper 22 bits
 * of each word contain an entry of the factor. The lower 10 bits contain parts of the sixth entry and of the opacity.
 */
export function packShape(words: Uint32Array, at: number, factor: Float64Array, opacity: number): void {
  const last = highBits(factor[5], 22);
  const visible = opacityBits(opacity);
  words[at] = (highBits(factor[0], 22) << 10) | (last >>> 12);
  words[at + 1] = (highBits(factor[1], 22) << 10) | ((last >>> 2) & 0x3ff);
  words[at + 2] = (highBits(factor[2], 22) << 10) | ((last & 3) << 8) | (visible >>> 20);
  words[at + 3] = (highBits(factor[3], 22) << 10) | ((visible >>> 10) & 0x3ff);
  words[at + 4] = (highBits(factor[4], 22) << 10) | (visible & 0x3ff);
}
