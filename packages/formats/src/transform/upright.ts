/** Rotation of clouds so that their direction up becomes (0, -1, 0), as in formats without a declared direction. */
import { type GaussianCloud, type Matrix3, type Vector3 } from '@gaussian-splat/core';
import { transformCloud } from './transform-cloud.js';

/** Cosine of the angle from (0, -1, 0) to the direction up, below which they are considered opposite. */
const OPPOSITE = -1 + 1e-9;

/**
 * Returns the row-major rotation from the direction up in a cloud's hints to (0, -1, 0). Undefined if the directions are
 * the same, or the hints have none.
 */
export function uprightRotation({ hints }: Pick<GaussianCloud, 'hints'>): Matrix3 | undefined {
  const up = hints?.up;
  if (up === undefined || (up[1] === -1 && up[0] === 0 && up[2] === 0)) return undefined;
  const cosine = -up[1];
  if (cosine < OPPOSITE) return [1, 0, 0, 0, -1, 0, 0, 0, -1];
  // Rodrigues' formula for the axis up × (0, -1, 0), which has no y component.
  const [x, z] = [up[2], -up[0]];
  const share = 1 / (1 + cosine);
  return [1 - z * z * share, -z, x * z * share, z, cosine, -x, x * z * share, x, 1 - x * x * share];
}

/** Returns a copy of a cloud, rotated about the world origin by a row-major rotation. */
export function turned(cloud: GaussianCloud, rotation: Matrix3): GaussianCloud {
  const { origin, positions, scales, rotations, opacities, sh } = cloud;
  const row = (k: number): number =>
    rotation[k] * origin[0] + rotation[k + 1] * origin[1] + rotation[k + 2] * origin[2];
  const copy = {
    ...cloud,
    origin: [row(0), row(3), row(6)] satisfies Vector3,
    ...{ positions: positions.slice(), scales: scales.slice(), rotations: rotations.slice() },
    ...{ opacities: opacities.slice(), sh: sh.slice() },
  };
  const [a, b, c, d, e, f, g, h, i] = rotation;
  transformCloud(copy, [a, b, c, 0, d, e, f, 0, g, h, i, 0]);
  return copy;
}

/** Returns a cloud with the up direction (0, -1, 0): the same one, or a rotated copy without `hints.up`. */
export function upright(cloud: GaussianCloud): GaussianCloud {
  const rotation = uprightRotation(cloud);
  if (rotation === undefined) return cloud;
  return { ...turned(cloud, rotation), hints: { ...cloud.hints, up: undefined } };
}
