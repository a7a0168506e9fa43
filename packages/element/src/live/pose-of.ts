import type { GeneratorInput } from './inputs.js';

/** A pose in the format that an input takes, of rotations as axis-angle in radians, three numbers a joint. */
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

/** Row-major. */
function matrixOf([w, x, y, z]: readonly number[]): number[] {
  return [
    ...[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    ...[2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    ...[2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}
