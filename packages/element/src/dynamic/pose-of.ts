import type { GeneratorInput } from './inputs.js';

/** Converts rotations as axis-angle in radians, three numbers for each joint, to the pose format of an input. */
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
    if (format === 'matrix') return matrixOf(q);
    return quaternionOrder === 'xyzw' ? [q[1], q[2], q[3], q[0]] : q;
  }).flat();
}

/**
 * The inverse: axis-angle of at most half a turn from a pose in the format of an input. Quaternions and matrices need
 * not be normalized.
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
      format === 'matrix' ? quaternionOf(own) : quaternionOrder === 'xyzw' ? [own[3], ...own.slice(0, 3)] : own;
    const length = Math.hypot(...axis);
    const share = length > 0 ? (2 * Math.atan2(Math.sign(w || 1) * length, Math.abs(w))) / length : 0;
    return axis.map((part) => part * share);
  }).flat();
}

/** w x y z of a rotation, row-major, by the formula of the four with the largest divisor. */
function quaternionOf([a, b, c, d, e, f, g, h, i]: readonly number[]): number[] {
  const ways = [
    [1 + a + e + i, h - f, c - g, d - b],
    [h - f, 1 + a - e - i, b + d, c + g],
    [c - g, b + d, 1 - a + e - i, f + h],
    [d - b, c + g, f + h, 1 - a - e + i],
  ];
  return ways.reduce((best, way, k) => (way[k] > best[ways.indexOf(best)] ? way : best));
}

/** Row-major. */
function matrixOf([w, x, y, z]: readonly number[]): number[] {
  return [
    ...[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    ...[2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    ...[2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}
