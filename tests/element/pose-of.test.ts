/** Rotations of joints, to the formats of poses and back. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { poseOf, turnsOf } from '../support/element/parts.js';

/**
 * Axis-angle, radians: nothing, little, around each axis, half turns, for which matrices divide by a different number
 * each.
 */
const TURNS = [
  ...[0, 0, 0],
  ...[1e-4, 0, -2e-4],
  ...[Math.PI / 2, 0, 0],
  ...[0.3, -1.2, 2],
  ...[3.1, 0.2, 0.1],
  ...[0.2, -3.1, 0.1],
  ...[-0.1, 0.2, 3.1],
];

for (const [name, input] of Object.entries({
  'axis-angle': { format: 'axis-angle' },
  'quaternions, w first': { format: 'quaternion' },
  'quaternions, w last': { format: 'quaternion', quaternionOrder: 'xyzw' },
  matrices: { format: 'matrix' },
} as const)) {
  test(`${name}: what is turned comes back`, () => {
    const back = turnsOf(poseOf(TURNS, input), input);
    assert.equal(back.length, TURNS.length);
    back.forEach((value, i) => assert.ok(Math.abs(value - TURNS[i]) < 1e-6, `${i}: ${value}, not ${TURNS[i]}`));
  });
}

test('a quaternion and its negative, of any length, are one rotation', () => {
  const quaternion = poseOf([0.3, -1.2, 2], { format: 'quaternion' });
  const [own, other] = [1, -3].map((scale) =>
    turnsOf(
      quaternion.map((value) => scale * value),
      { format: 'quaternion' },
    ),
  );
  own.forEach((value, i) => assert.ok(Math.abs(value - other[i]) < 1e-12));
});
