import {
  isUsable,
  shCoefficientCount,
  validateCloud,
  type GaussianCloud,
  type ShDegree,
  type Vector3,
} from '@gaussian-splat/core';
import { layouts } from './generated/shaders.js';
import { halfBits } from './gpu/half.js';

/**
 * A cloud in the exact bytes that the GPU reads. Plain data with transferable buffers, so that a worker can make it.
 */
export interface PackedGaussians {
  readonly count: number;
  readonly shDegree: ShDegree;
  readonly antialiased: boolean;
  readonly origin: Vector3;
  readonly droppedCount: number;
  /** [N, 12] words: `PackedGaussian` of shaders/shared/gaussian.wgsl. */
  readonly geometry: Uint32Array;
  /** [N, {@link shWords}] words: float16 coefficients in the order [coefficient][channel], padded to 8 bytes. */
  readonly sh: Uint32Array;
}

/** 32-bit words of one splat's geometry. */
export const GEOMETRY_WORDS = layouts.PackedGaussian.size / 4;

/** 32-bit words of one splat's spherical harmonics: 2, 6, 14 or 24 for degree 0 to 3. */
export function shWords(degree: ShDegree): number {
  return 2 * Math.ceil((3 * shCoefficientCount(degree)) / 4);
}

/**
 * Packs a cloud for {@link GaussianBuffers.upload}. Coefficients are rounded to float16 (98 dB on captured scenes),
 * everything else stays float32. Splats that core's `isUsable` refuses are left out and added to `droppedCount`.
 * @throws GaussianSplatError `argument/cloud` if the arrays do not match `count` and `shDegree`.
 */
export function packGaussians(cloud: GaussianCloud): PackedGaussians {
  validateCloud(cloud);
  const { shDegree, antialiased, origin } = cloud;
  const kept = usableIndices(cloud);
  const droppedCount = cloud.droppedCount + cloud.count - kept.length;
  const plain = { count: kept.length, shDegree, antialiased, origin, droppedCount };
  return { ...plain, geometry: packGeometry(cloud, kept), sh: packSh(cloud, kept) };
}

function usableIndices(cloud: GaussianCloud): Uint32Array {
  const indices = new Uint32Array(cloud.count);
  let kept = 0;
  for (let i = 0; i < cloud.count; i++) if (isUsable(cloud, i)) indices[kept++] = i;
  return indices.subarray(0, kept);
}

function packGeometry({ positions, opacities, rotations, scales }: GaussianCloud, kept: Uint32Array): Uint32Array {
  const words = new Float32Array(kept.length * GEOMETRY_WORDS);
  let at = 0;
  for (const i of kept) {
    words[at] = positions[3 * i];
    words[at + 1] = positions[3 * i + 1];
    words[at + 2] = positions[3 * i + 2];
    words[at + 3] = opacities[i];
    words[at + 4] = rotations[4 * i];
    words[at + 5] = rotations[4 * i + 1];
    words[at + 6] = rotations[4 * i + 2];
    words[at + 7] = rotations[4 * i + 3];
    words[at + 8] = scales[3 * i];
    words[at + 9] = scales[3 * i + 1];
    words[at + 10] = scales[3 * i + 2];
    at += GEOMETRY_WORDS;
  }
  return new Uint32Array(words.buffer);
}

function packSh({ sh, shDegree }: GaussianCloud, kept: Uint32Array): Uint32Array {
  const numbers = 3 * shCoefficientCount(shDegree);
  const stride = 2 * shWords(shDegree);
  const halves = new Uint16Array(kept.length * stride);
  let at = 0;
  for (const i of kept) {
    for (let k = 0; k < numbers; k++) halves[at + k] = halfBits(sh[i * numbers + k]);
    at += stride;
  }
  return new Uint32Array(halves.buffer);
}
