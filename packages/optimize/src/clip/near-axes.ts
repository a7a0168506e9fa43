import type { GaussianCloud } from '@gaussian-splat/core';

const HALF = Math.SQRT1_2;
/** Minimum scale, so that logarithms are finite. */
const EPSILON = 1e-12;
/** Quaternions of the identity and of half turns about each axis, which only change the signs of axes. */
const HALF_TURNS = [0, 1, 2, 3].map((axis) => [0, 1, 2, 3].map((k) => (k === axis ? 1 : 0)));
/**
 * All rotations that permute the axes of an ellipsoid: the quaternion `turn`, and the indices of the axes that become the
 * first, second and third axis. The first rotation is the identity.
 */
const RENAMINGS: readonly { readonly turn: readonly number[]; readonly axes: readonly number[] }[] = [
  { turn: [1, 0, 0, 0], axes: [0, 1, 2] },
  { turn: [HALF, HALF, 0, 0], axes: [0, 2, 1] },
  { turn: [HALF, 0, HALF, 0], axes: [2, 1, 0] },
  { turn: [HALF, 0, 0, HALF], axes: [1, 0, 2] },
  { turn: [0.5, 0.5, 0.5, 0.5], axes: [1, 2, 0] },
  { turn: [0.5, -0.5, -0.5, -0.5], axes: [2, 0, 1] },
].flatMap(({ turn, axes }) => HALF_TURNS.map((half) => ({ turn: product(turn, half), axes })));

function product([w, x, y, z]: readonly number[], [a, b, c, d]: readonly number[]): number[] {
  return [
    w * a - x * b - y * c - z * d,
    w * b + x * a + y * d - z * c,
    w * c - x * d + y * a + z * b,
    w * d + x * c - y * b + z * a,
  ];
}

/**
 * Squared difference from the previous frame, in radians and natural logarithms, below which the order of axes has not
 * changed.
 */
const NEAR = 0.1;

/**
 * Returns a cloud whose splats have their axes in the order that is nearest to the rotations and scales of `near`. Tools
 * that decompose covariances sort axes by length, so that their order changes when splats deform.
 */
export function alignAxes(cloud: GaussianCloud, near: GaussianCloud): GaussianCloud {
  const [rotations, scales] = [cloud.rotations.slice(), cloud.scales.slice()];
  for (let i = 0; i < cloud.count; i++) {
    const own = cloud.rotations.subarray(4 * i, 4 * i + 4);
    const other = near.rotations.subarray(4 * i, 4 * i + 4);
    const apart = (axis: number, k: number): number =>
      Math.log(Math.max(EPSILON, cloud.scales[3 * i + axis]) / Math.max(EPSILON, near.scales[3 * i + k])) ** 2;
    const angle = (turned: ArrayLike<number>): number => {
      const cos = turned[0] * other[0] + turned[1] * other[1] + turned[2] * other[2] + turned[3] * other[3];
      return 2 * Math.acos(Math.min(1, Math.abs(cos)));
    };
    let min = angle(own) ** 2 + apart(0, 0) + apart(1, 1) + apart(2, 2);
    if (min < NEAR) continue;
    for (const { turn, axes } of RENAMINGS) {
      const turned = product([...own], turn);
      const cost = angle(turned) ** 2 + axes.reduce((sum, axis, k) => sum + apart(axis, k), 0);
      if (cost >= min) continue;
      min = cost;
      rotations.set(turned, 4 * i);
      axes.forEach((axis, k) => (scales[3 * i + k] = cloud.scales[3 * i + axis]));
    }
  }
  return { ...cloud, rotations, scales };
}
