import { viewOf } from '../bytes.js';

/** Size in bytes of a splat in a `.splat` file. */
export const SPLAT_BYTES = 32;

/** Maximum number of splats that are sampled, evenly spaced over the file. */
const SAMPLES = 64;

/**
 * Whether bytes resemble a `.splat` file, which has no signature. Coordinates of plausible splats are within ±1e6.
 * Standard deviations are from 0 to 1e4, not all 0. Quaternions have a length near 1.
 * @param share Fraction of the sampled splats that must be plausible. `all` is the test if nothing else indicates the
 * format. `at least half` only rejects implausible files, and ignores quaternions.
 */
export function looksLikeSplats(bytes: Uint8Array, share: 'all' | 'at least half'): boolean {
  const count = Math.floor(bytes.length / SPLAT_BYTES);
  const samples = Math.min(count, SAMPLES);
  const view = viewOf(bytes);
  let plausible = 0;
  for (let k = 0; k < samples; k++) {
    const at = SPLAT_BYTES * Math.floor((k * count) / samples);
    if (hasPlausibleFloats(view, at) && (share !== 'all' || hasUnitQuaternion(bytes, at))) plausible++;
  }
  return samples > 0 && (share === 'all' ? plausible === samples : 2 * plausible >= samples);
}

function hasPlausibleFloats(view: DataView, at: number): boolean {
  const floats = [0, 1, 2, 3, 4, 5].map((k) => view.getFloat32(at + 4 * k, true));
  const positions = floats.slice(0, 3);
  const scales = floats.slice(3);
  // These comparisons are false for NaN.
  return (
    positions.every((p) => Math.abs(p) <= 1e6) && scales.every((s) => s >= 0 && s <= 1e4) && scales.some((s) => s > 0)
  );
}

function hasUnitQuaternion(bytes: Uint8Array, at: number): boolean {
  const components = [28, 29, 30, 31].map((k) => (bytes[at + k] - 128) / 128);
  return Math.abs(Math.hypot(...components) - 1) < 0.1;
}
