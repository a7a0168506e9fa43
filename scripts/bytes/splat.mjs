import { shCoefficientCount } from '@gaussian-splat/core';

const SH_C0 = 0.28209479177387814;
const byte = (value) => Math.min(255, Math.max(0, Math.round(value)));

/** A cloud as `.splat`: 32 bytes each, no harmonics. */
export function writeSplat({ count, positions, origin, scales, rotations, opacities, sh, shDegree }) {
  const bytes = new Uint8Array(32 * count);
  const view = new DataView(bytes.buffer);
  const stride = 3 * shCoefficientCount(shDegree);
  for (let i = 0; i < count; i++) {
    const at = 32 * i;
    for (let axis = 0; axis < 3; axis++) {
      view.setFloat32(at + 4 * axis, positions[3 * i + axis] + origin[axis], true);
      view.setFloat32(at + 12 + 4 * axis, scales[3 * i + axis], true);
      bytes[at + 24 + axis] = byte(255 * (0.5 + SH_C0 * sh[stride * i + axis]));
    }
    bytes[at + 27] = byte(255 * opacities[i]);
    for (let k = 0; k < 4; k++) bytes[at + 28 + k] = byte(128 + 128 * rotations[4 * i + k]);
  }
  return bytes;
}
