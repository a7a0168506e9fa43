import { dot, eyeOf, normalize, subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import { constants } from './generated/shaders.js';

const { SIDE_WORDS } = constants;
const GOLDEN_ANGLE = Math.PI * (3 - Math.sqrt(5));

/** Directions from a scene's middle that it is looked at from, evenly spread over all of them (a Fibonacci lattice), some 18° from one to the next. */
export const SIDES: readonly Vector3[] = Array.from({ length: constants.SIDES }, (_, k) => {
  const y = 1 - (2 * k + 1) / constants.SIDES;
  const [across, angle] = [Math.sqrt(1 - y * y), k * GOLDEN_ANGLE];
  return [across * Math.cos(angle), y, across * Math.sin(angle)];
});

/** Sides that a picture is drawn from: the nearest, and those around it. */
const NEAR_SIDES = 7;
/** In radii of the scene: a camera nearer to the middle sees what none from outside does. */
const NEAREST = 0.95;

/** The sphere around a scene that it was looked at from. */
export interface Surroundings {
  readonly center: Vector3;
  readonly radius: number;
}

/** [4] a bit for each of the {@link SIDES} near a camera; none where all splats are to be drawn, for the camera is among them. */
export function sidesNear({ worldToCamera }: Pick<Camera, 'worldToCamera'>, around: Surroundings): Uint32Array {
  const bits = new Uint32Array(SIDE_WORDS);
  const away = subtract(eyeOf(worldToCamera), around.center);
  const distance = Math.hypot(...away);
  if (!(distance >= NEAREST * around.radius)) return bits;
  const direction = normalize(away);
  const likeness = SIDES.map((side) => dot(side, direction));
  const least = [...likeness].sort((a, b) => b - a)[NEAR_SIDES - 1];
  likeness.forEach((value, k) => {
    if (value >= least) bits[k >>> 5] |= 1 << (k & 31);
  });
  return bits;
}
