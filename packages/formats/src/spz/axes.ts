import { GaussianSplatError } from '@gaussian-splat/core';
import { viewOf } from '../bytes.js';

/** Factor, 1 or -1, of each axis of a file on its way into a cloud's frame (x right, y down, z forward). */
export type AxisSigns = readonly [x: 1 | -1, y: 1 | -1, z: 1 | -1];

/** x right, y up, z back: the frame of SPZ files that do not name another. */
export const RIGHT_UP_BACK: AxisSigns = [1, -1, -1];

/** Adobe's record of the frame a file is in, one of 16 in the numbering of SPZ's `CoordinateSystem`. */
const COORDINATE_SYSTEM = 0xadbe0003;
/** Padding; and Adobe's record of where cameras may go, which changes no splat. */
const MEANINGLESS = new Set([0, 0xadbe0002]);
const MOST_SKIPPED = 8;

/**
 * Finds the frame that extension records name: `[uint32 type][uint32 length][payload]`, one after another. Records of
 * other types are skipped, and listed. Systems 1 to 8 differ from ours in signs only, bit 0 of (system - 1) meaning right, bit 1
 * up and bit 2 forward; the rest swap axes, which `decode/unsupported` says.
 */
export function readExtensions(records: Uint8Array, name: string): { axes: AxisSigns; skipped: readonly number[] } {
  const view = viewOf(records);
  const skipped = new Set<number>();
  let axes: AxisSigns | undefined;
  for (let at = 0; at + 8 <= records.length;) {
    const type = view.getUint32(at, true);
    const length = view.getUint32(at + 4, true);
    if (at + 8 + length > records.length) break;
    if (type === COORDINATE_SYSTEM && length >= 4) axes ??= axesOfSystem(view.getUint32(at + 8, true), name);
    else if (!MEANINGLESS.has(type) && skipped.size < MOST_SKIPPED) skipped.add(type);
    at += 8 + length;
  }
  return { axes: axes ?? RIGHT_UP_BACK, skipped: [...skipped] };
}

function axesOfSystem(system: number, name: string): AxisSigns {
  if (system === 0) return RIGHT_UP_BACK;
  if (system <= 8) {
    const bits = system - 1;
    return [bits & 1 ? 1 : -1, bits & 2 ? -1 : 1, bits & 4 ? 1 : -1];
  }
  throw new GaussianSplatError('decode/unsupported', {
    where: `${name}, SPZ extension 0xADBE0003 (coordinate system)`,
    expected: 'a system from 0 to 8, whose second axis is vertical',
    found: String(system),
    remedy: 'export the scene again in the right-up-back (RUB) system, which is the default of SPZ',
  });
}

/**
 * Factors of the components x, y and z of a quaternion (w is not changed): a mirrored axis turns the sense of the
 * rotations about the other two.
 */
export function quaternionSigns([x, y, z]: AxisSigns): readonly [number, number, number] {
  return [y * z, x * z, x * y];
}

/**
 * Factors of the 15 coefficients of spherical harmonics of degrees 1 to 3: the sign that x, y and z give to the
 * polynomial of each, in the order of 3D Gaussian Splatting.
 */
export function harmonicSigns([x, y, z]: AxisSigns): readonly number[] {
  const degree1 = [y, z, x];
  const degree2 = [x * y, y * z, 1, x * z, 1];
  const degree3 = [y, x * y * z, y, z, x, z, x];
  return [...degree1, ...degree2, ...degree3];
}
