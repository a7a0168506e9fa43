import { matrixOfQuaternion, quaternionOfMatrix, type Matrix3 } from '@gaussian-splat/core';
import type { GeneratorInput } from './inputs.js';

/**
 * Converts rotations to the pose format of an input.
 * @param turns [J, 3] axis-angle rotations of the joints, radians.
 */
export function poseOf(
  turns: readonly number[],
  { format, quaternionOrder }: Pick<GeneratorInput, 'format' | 'quaternionOrder'>,
): number[] {
  if (format === 'axis-angle') return [...turns];
  return Array.from({ length: turns.length / 3 }, (_, joint) => {
    const [x, y, z] = turns.slice(3 * joint, 3 * joint + 3);
    const angle = Math.hypot(x, y, z);
    const share = angle > 0 ? Math.sin(angle / 2) / angle : 0;
    const q = [Math.cos(angle / 2), x * share, y * share, z * share];
    if (format === 'matrix') return matrixOfQuaternion(q[0], q[1], q[2], q[3]);
    return quaternionOrder === 'xyzw' ? [q[1], q[2], q[3], q[0]] : q;
  }).flat();
}

/**
 * Inverse of {@link poseOf}: returns [J, 3] axis-angle rotations of at most half a turn, radians, from a pose in the
 * format of an input. Quaternions and matrices need not be normalized.
 */
export function turnsOf(
  pose: readonly number[],
  { format, quaternionOrder }: Pick<GeneratorInput, 'format' | 'quaternionOrder'>,
): number[] {
  if (format === 'axis-angle') return [...pose];
  const numbers = format === 'matrix' ? 9 : 4;
  return Array.from({ length: pose.length / numbers }, (_, joint) => {
    const own = pose.slice(numbers * joint, numbers * (joint + 1));
    const [w, ...axis] =
      format === 'matrix'
        ? quaternionOfMatrix(own as unknown as Matrix3)
        : quaternionOrder === 'xyzw'
          ? [own[3], ...own.slice(0, 3)]
          : own;
    const length = Math.hypot(...axis);
    const share = length > 0 ? (2 * Math.atan2(Math.sign(w || 1) * length, Math.abs(w))) / length : 0;
    return axis.map((part) => part * share);
  }).flat();
}
