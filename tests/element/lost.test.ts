/** After any input to a camera, the scene is visible, or one action away. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Bounds, Camera, Vector3 } from '@gaussian-splat/core';
import fc from 'fast-check';
import {
  keyOf,
  orbitOf,
  panOf,
  pinchOf,
  wheelOf,
  type CameraAction,
  toViewer,
  CameraController,
} from '../support/element/camera.js';
import { settings } from '../support/camera-settings.js';

const BOUNDS: Bounds = { min: [0, 1, 2], max: [2, 5, 4], center: [1, 3, 3], radius: 2 };
/** Phone and desktop, CSS pixels. */
const SCREENS = [
  [390, 500],
  [1280, 720],
] as const;

const place = (width: number, height: number): fc.Arbitrary<{ x: number; y: number }> =>
  fc.record({ x: fc.integer({ min: 0, max: width }), y: fc.integer({ min: 0, max: height }) });

/** One gesture of a hand on a view of this size. */
function gesture(width: number, height: number): fc.Arbitrary<CameraAction[]> {
  const point = place(width, height);
  const key = fc.constantFrom('ArrowLeft', 'ArrowRight', 'ArrowUp', 'ArrowDown', 'PageUp', 'PageDown');
  return fc.oneof(
    fc.tuple(point, point).map(([from, to]) => [orbitOf(from, to, height)]),
    fc.tuple(point, point).map(([from, to]) => [panOf(from, to, height)]),
    fc.tuple(point, point, point, point).map(([a, b, c, d]) => pinchOf([a, b], [c, d], height)),
    fc
      .record({ deltaY: fc.integer({ min: -300, max: 300 }), ctrlKey: fc.boolean() })
      .map((wheel) => [wheelOf({ ...wheel, deltaMode: 0 })]),
    fc.tuple(key, fc.boolean()).map(([name, shift]) => [keyOf(name, shift)].filter((action) => action !== null)),
  );
}

function act(controller: CameraController, action: CameraAction): void {
  if (action.type === 'orbit') controller.orbitBy(action.theta, action.phi);
  else if (action.type === 'pan') controller.panBy(action.right, action.up);
  else if (action.type === 'zoom') controller.zoomBy(action.factor);
}

const middle = (controller: CameraController): Vector3 => toViewer(controller.viewerFrame, BOUNDS.center);

function fromMiddle(controller: CameraController): number {
  const { x, y, z } = controller.target;
  const [a, b, c] = middle(controller);
  return Math.hypot(x - a, y - b, z - c);
}

/** Whether the whole framed ball is in view. */
function showsAll({ worldToCamera: m, width, height, fx, fy }: Camera): boolean {
  const [x, y, z] = [0, 4, 8].map(
    (row) => m[row] * BOUNDS.center[0] + m[row + 1] * BOUNDS.center[1] + m[row + 2] * BOUNDS.center[2] + m[row + 3],
  );
  const reach = (half: number, focal: number): number => Math.sin(Math.atan(half / focal)) * Math.hypot(x, y, z);
  return (
    z > 0 &&
    Math.hypot(x, y) < 1e-6 * z &&
    Math.min(reach(width / 2, fx), reach(height / 2, fy)) >= BOUNDS.radius * (1 - 1e-9)
  );
}

for (const [width, height] of SCREENS) {
  test(`100 gestures at ${width} x ${height}: the target stays in the ball that is framed, and one action shows all of it`, () => {
    fc.assert(
      fc.property(fc.array(gesture(width, height), { minLength: 100, maxLength: 100 }), (gestures) => {
        const controller = new CameraController(settings(), () => undefined);
        controller.setAspect(width / height);
        controller.frame(BOUNDS);
        for (const action of gestures.flat()) {
          act(controller, action);
          controller.jumpToGoal();
          assert.ok(fromMiddle(controller) <= BOUNDS.radius * (1 + 1e-9), `${fromMiddle(controller)} from the middle`);
        }
        controller.reset('user-interaction');
        controller.jumpToGoal();
        assert.ok(showsAll(controller.view(width, height)), 'all of it');
        assert.equal(controller.isTouched, false);
      }),
      { numRuns: 30 },
    );
  });
}

test('limits of the target that a page sets count alone, on every axis that they name', () => {
  const limited = { minCameraTarget: '-5 auto -4', maxCameraTarget: '5 auto -2' };
  const controller = new CameraController(settings({ ...limited, cameraOrbit: '0deg 90deg 10m' }), () => undefined);
  controller.frame(BOUNDS);
  controller.panBy(-100, -100);
  controller.jumpToGoal();
  assert.equal(controller.target.x, -5);
  assert.ok(controller.target.y < -100, 'no limit upwards and downwards');
  controller.aimAt([9, 9, 9]);
  controller.jumpToGoal();
  assert.deepEqual([controller.target.x, controller.target.y, controller.target.z], [5, 9, -2]);
});

test('a target farther out, of an attribute or of a double click, is left there, and no pan goes farther', () => {
  const controller = new CameraController(settings({ cameraTarget: '20 -3 -3' }), () => undefined);
  controller.frame(BOUNDS);
  assert.equal(controller.target.x, 20);
  const before = fromMiddle(controller);
  controller.panBy(3, 0);
  controller.jumpToGoal();
  assert.ok(fromMiddle(controller) <= before * (1 + 1e-9));
  controller.panBy(-0.5, 0);
  controller.jumpToGoal();
  assert.ok(fromMiddle(controller) < before - 0.5, 'towards the middle it goes as always');
});

test('what is set again counts again, and the way there is the short one', () => {
  const side = settings({ cameraOrbit: '90deg 75deg 6m' });
  const controller = new CameraController(side, () => undefined);
  controller.frame(BOUNDS);
  controller.orbitBy(-8, 0);
  controller.zoomBy(0.5);
  controller.jumpToGoal();
  controller.applySettings(side);
  assert.equal(controller.isMoving, false, 'nothing was set');
  controller.applySettings(side, new Set(['orbit']));
  let farthest = 0;
  for (let now = 0; controller.isMoving; now += 16) {
    controller.step(now, 50);
    farthest = Math.max(farthest, Math.abs(controller.orbit.theta - Math.PI / 2));
  }
  assert.ok(Math.abs(controller.orbit.theta - Math.PI / 2) < 1e-9);
  assert.ok(farthest <= Math.PI, `${farthest} of a turn`);
  assert.equal(controller.orbit.radius, 6);
});

test('zooming says when it has come to its limit', () => {
  const controller = new CameraController(settings({ maxCameraOrbit: 'auto auto 9m' }), () => undefined);
  controller.frame(BOUNDS);
  assert.equal(controller.zoomBy(1.1), true);
  assert.equal(controller.zoomBy(100), true);
  assert.equal(controller.zoomBy(1.1), false);
  assert.equal(controller.zoomBy(0.9), true);
});
