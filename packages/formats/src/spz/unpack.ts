import { halfToNumber, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { viewOf } from '../bytes.js';
import { allocateCloud, expInPlace, keptDegree } from '../cloud.js';
import { addCredits } from '../credits.js';
import { DEGREE_4, warn } from '../faults.js';
import { harmonicSigns, quaternionSigns, type AxisSigns } from './axes.js';
import { bytesPerSplat, type SpzHeader } from './header.js';
import type { SceneSource } from '../scene-format.js';
import type { PackedScene } from './streams.js';

/** Factor of constant coefficients in stored colors, 0.5 + 0.15·f_dc, so that colors may be outside 0..1. */
const COLOR_SCALE = 0.15;

/** Returns the cloud of packed attributes, as `unpackGaussians` in SPZ's `src/cc/load-spz.cc` defines them. */
export function unpackSplats(
  header: SpzHeader,
  { attributes, axes, isAssumed, order, orbit, credits, skipped = [] }: PackedScene,
  source: Pick<SceneSource, 'budget' | 'name'>,
): GaussianCloud {
  const cloud = allocateCloud(header.count, keptDegree(header.degree), source);
  cloud.antialiased = header.antialiased;
  if (isAssumed || order || orbit)
    cloud.hints = { ...(isAssumed && { isUpAssumed: true }), ...(order && { order }), ...(orbit && { orbit }) };
  addCredits(cloud, credits);
  if (header.degree === 4) warn(cloud, DEGREE_4);
  for (const type of skipped) warn(cloud, `The SPZ extension 0x${type.toString(16)} is left out.`);
  if (header.version === 1) unpackHalfPositions(attributes.positions, axes, cloud.positions);
  else unpackFixedPositions(attributes.positions, header.fractionalBits, axes, cloud.positions);
  for (let i = 0; i < cloud.scales.length; i++) cloud.scales[i] = attributes.scales[i] / 16 - 10;
  expInPlace(cloud.scales);
  if (header.version >= 3) unpackSmallestThree(attributes.rotations, axes, cloud.rotations);
  else unpackFirstThree(attributes.rotations, axes, cloud.rotations);
  for (let i = 0; i < header.count; i++) cloud.opacities[i] = attributes.opacities[i] / 255;
  const shStride = 3 * shCoefficientCount(cloud.shDegree);
  for (let i = 0; i < 3 * header.count; i++) {
    cloud.sh[shStride * Math.floor(i / 3) + (i % 3)] = (attributes.colors[i] / 255 - 0.5) / COLOR_SCALE;
  }
  unpackHarmonics(attributes.harmonics, header, axes, cloud.sh, shStride);
  return cloud;
}

/** Writes positions, [N, 3], from 24-bit signed fixed-point coordinates. */
function unpackFixedPositions(packed: Uint8Array, fractionalBits: number, axes: AxisSigns, out: Float32Array): void {
  const unit = 2 ** -fractionalBits;
  for (let i = 0; i < out.length; i++) {
    const high = (packed[3 * i] << 8) | (packed[3 * i + 1] << 16) | (packed[3 * i + 2] << 24);
    out[i] = axes[i % 3] * (high >> 8) * unit;
  }
}

function unpackHalfPositions(packed: Uint8Array, axes: AxisSigns, out: Float32Array): void {
  const view = viewOf(packed);
  for (let i = 0; i < out.length; i++) out[i] = axes[i % 3] * halfToNumber(view.getUint16(2 * i, true));
}

/**
 * Writes quaternions (w, x, y, z), [N, 4], of versions 1 and 2: x, y and z are bytes, -1..1. The component w is not
 * negative, and follows from the unit length.
 */
function unpackFirstThree(packed: Uint8Array, axes: AxisSigns, out: Float32Array): void {
  const signs = quaternionSigns(axes);
  for (let i = 0; 4 * i < out.length; i++) {
    let squares = 0;
    for (let k = 0; k < 3; k++) {
      const value = packed[3 * i + k] / 127.5 - 1;
      out[4 * i + 1 + k] = signs[k] * value;
      squares += value * value;
    }
    out[4 * i] = Math.sqrt(Math.max(0, 1 - squares));
  }
}

/**
 * Writes quaternions (w, x, y, z), [N, 4], of versions 3 and 4. The highest two bits are the index of the largest
 * component of (x, y, z, w), which is not stored. Each other component has a sign bit, and 9 bits of magnitude up to
 * 1/sqrt(2).
 */
function unpackSmallestThree(packed: Uint8Array, axes: AxisSigns, out: Float32Array): void {
  const signs = [...quaternionSigns(axes), 1];
  const view = viewOf(packed);
  for (let i = 0; 4 * i < out.length; i++) {
    const word = view.getUint32(4 * i, true);
    const largest = word >>> 30;
    let squares = 0;
    for (let component = 3, shift = 0; component >= 0; component--) {
      if (component === largest) continue;
      const magnitude = (((word >>> shift) & 511) / 511) * Math.SQRT1_2;
      const isNegative = ((word >>> (shift + 9)) & 1) === 1;
      out[4 * i + ((component + 1) & 3)] = signs[component] * (isNegative ? -magnitude : magnitude);
      squares += magnitude * magnitude;
      shift += 10;
    }
    out[4 * i + ((largest + 1) & 3)] = signs[largest] * Math.sqrt(Math.max(0, 1 - squares));
  }
}

/** Writes coefficients above the constant one from bytes, -1..1, whose channels are interleaved as in a cloud. */
function unpackHarmonics(
  packed: Uint8Array,
  { version, degree, count }: SpzHeader,
  axes: AxisSigns,
  sh: Float32Array,
  shStride: number,
): void {
  const signs = harmonicSigns(axes);
  const stored = bytesPerSplat(version, degree).harmonics;
  const kept = shStride - 3;
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < kept; k++) {
      sh[shStride * i + 3 + k] = (signs[Math.floor(k / 3)] * (packed[stored * i + k] - 128)) / 128;
    }
  }
}
