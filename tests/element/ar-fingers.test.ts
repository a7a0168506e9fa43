/** Fingers on a phone's screen, as points of a floor or a wall. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { fingersOn, type Plane } from '../../packages/element/dist/features/xr/fingers.js';

const EYE = [0, 1.5, 0];

/** A frame with fingers whose rays lead from the eye through points. */
function frameOf(points: readonly (readonly number[])[], targetRayMode = 'screen') {
  const inputSources = points.map((point) => {
    const way = point.map((value, k) => value - EYE[k]);
    const back = way.map((value) => -value / Math.hypot(...way));
    return { targetRayMode, targetRaySpace: [1, 0, 0, 0, 0, 1, 0, 0, ...back, 0, ...EYE, 1] };
  });
  const getPose = (matrix: readonly number[]) => ({ transform: { matrix: Float32Array.from(matrix) } });
  return { session: { inputSources }, getPose } as never;
}

const FLOOR: Plane = { point: [0, 0, -2], axes: [[1, 0, 0], [0, 0, 1]] }; // prettier-ignore
/** A wall at eye level, ahead. */
const WALL: Plane = { point: [0, 1.5, -2], axes: [[1, 0, 0], [0, 1, 0]] }; // prettier-ignore

const near = (found: number, expected: number): void =>
  assert.ok(Math.abs(found - expected) < 1e-5, `${found} in place of ${expected}`);

test('a finger is where its ray meets the plane', () => {
  const onFloor = fingersOn(FLOOR, frameOf([[0.3, 0, -1]]), {} as never)!;
  near(onFloor.u, 0.3);
  near(onFloor.v, -1);
  const onWall = fingersOn(WALL, frameOf([[-0.4, 1.7, -2]]), {} as never)!;
  near(onWall.u, -0.4);
  near(onWall.v, 1.7);
  assert.equal(onWall.count, 1);
});

test('two fingers have a middle, a distance and an angle', () => {
  const { count, u, v, apart, angle } = fingersOn(WALL, frameOf([[-1, 1, -2], [1, 2, -2], [0, 0, -2]]), {} as never)!; // prettier-ignore
  assert.equal(count, 2);
  near(u, 0);
  near(v, 1.5);
  near(apart, Math.hypot(2, 1));
  near(angle, Math.atan2(1, 2));
});

test('rays that miss the plane or meet it far away, and those of controllers, are no fingers', () => {
  assert.equal(fingersOn(FLOOR, frameOf([[0, 0, -30]]), {} as never), undefined);
  assert.equal(fingersOn(FLOOR, frameOf([[0, 2, -1]]), {} as never), undefined);
  assert.equal(fingersOn(FLOOR, frameOf([[0, 0, -1]], 'tracked-pointer'), {} as never), undefined);
});
