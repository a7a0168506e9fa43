import type { Contract, Vector3 } from '@gaussian-splat/core';
import { parseUp } from '../camera/grammar.js';
import type { SceneBounds } from '../camera/settings.js';

/** What a contract says of where its Gaussians are: bounds of the centres are those of the subject, too. Undefined where it says nothing. */
export function declaredBounds(contract: Contract): SceneBounds | undefined {
  const { bounds } = contract;
  if (bounds === undefined) return undefined;
  const { min, max } = bounds;
  const center = [0, 1, 2].map((axis) => (min[axis] + max[axis]) / 2) as [number, number, number];
  const sides = [0, 1, 2].map((axis) => max[axis] - min[axis]);
  // Centres fill a box's corners seldom: the ball that 90 % of them are in is smaller than the one around the box, but what is long reaches both of its ends.
  const radius = Math.max(0.7 * Math.hypot(...sides), ...sides) / 2 || 1;
  return { min, max, center, radius, up: upOf(contract) };
}

/** The direction that points up by a contract, of length 1; undefined where it says nothing. */
export const upOf = ({ coordinates }: Contract): Vector3 | undefined =>
  parseUp(coordinates?.up?.replace('+', '') ?? '') ?? undefined;
