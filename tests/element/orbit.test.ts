import assert from 'node:assert/strict';
import { test } from 'node:test';
import { cross, dot, eyeOf, lookAt, type Bounds, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import fc from 'fast-check';
import {
  keyOf,
  orbitOf,
  panOf,
  pinchOf,
  wheelOf,
  cameraOfPose,
  eyeOfPose,
  framingDistance,
  nearPlane,
  orbitAxes,
  toScene,
  toViewer,
  viewerFrame,
  type CameraPose,
  OrbitCamera,
  limitsOf,
  poseOf,
  project,
  CameraController,
} from '../support/element/camera.js';
import { boxOf, LabelView, type Located } from '../support/element/parts.js';
import { settings } from '../support/camera-settings.js';

/** Rows of the frame of each up axis, as they stand in no formula. */
const FRAMES: readonly (readonly [Vector3, Vector3, Vector3])[] = [
  [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
  [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
  [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
  [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
  [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
]; // prettier-ignore
const UPS: readonly Vector3[] = [...FRAMES.map(([, up]) => up), [0.48, -0.6, 0.64], [-0.48, 0.6, -0.64], [0.6, 0, 0.8]];
const BOUNDS: Bounds = { min: [0, 1, 2], max: [2, 5, 4], center: [1, 3, 3], radius: 2 };

const near = (actual: ArrayLike<number>, expected: ArrayLike<number>, tolerance = 1e-9): void => {
  assert.equal(actual.length, expected.length);
  for (let i = 0; i < actual.length; i++) {
    assert.ok(Math.abs(actual[i] - expected[i]) <= tolerance, `[${i}] ${actual[i]} is not ${expected[i]}`);
  }
};

const pixelOf = (
  camera: { fx: number; fy: number; cx: number; cy: number; worldToCamera: Matrix4 },
  p: Vector3,
): number[] => {
  const m = camera.worldToCamera;
  const [x, y, z] = [0, 4, 8].map((row) => m[row] * p[0] + m[row + 1] * p[1] + m[row + 2] * p[2] + m[row + 3]);
  return [(camera.fx * x) / z + camera.cx, (camera.fy * y) / z + camera.cy, z];
};

test('viewer frames are rotations that bring the up axis to +y', () => {
  for (const up of UPS) {
    const frame = viewerFrame(up);
    near(toViewer(frame, up), [0, 1, 0]);
    near(cross(frame[0], frame[1]), frame[2]);
    near(frame.map((row) => dot(row, row)), [1, 1, 1]); // prettier-ignore
    near(toScene(frame, toViewer(frame, [1, 2, 3])), [1, 2, 3]);
  }
  for (const frame of FRAMES) assert.deepEqual(viewerFrame(frame[1]), frame);
});

test('a capture that is tilted a little is turned a little: degrees of theta mean what they meant', () => {
  for (const axis of [-1, 1]) {
    const [tilted, straight] = [viewerFrame([0.01, axis * Math.sqrt(1 - 2e-4), 0.01]), viewerFrame([0, axis, 0])];
    for (let row = 0; row < 3; row++) near(tilted[row], straight[row], 0.0101);
  }
});

test("the camera of a pose is core's lookAt from the same eye, for every up axis", () => {
  const angle = fc.double({ min: -7, max: 7, noNaN: true });
  const phi = fc.double({ min: 0.01, max: 3.13, noNaN: true });
  const length = fc.double({ min: -100, max: 100, noNaN: true });
  fc.assert(
    fc.property(fc.constantFrom(...UPS), angle, phi, length, length, length, (up, theta, phi, x, y, z) => {
      const frame = viewerFrame(up);
      const pose: CameraPose = { theta, phi, radius: 3, x, y, z, fieldOfView: 1 };
      const camera = cameraOfPose(pose, frame, 640, 480, 0.2);
      // Spherical coordinates as the attributes define them, from the formula and not from the code.
      const eye = toScene(frame, [
        x + 3 * Math.sin(theta) * Math.sin(phi),
        y + 3 * Math.cos(phi),
        z + 3 * Math.cos(theta) * Math.sin(phi),
      ]);
      near(eyeOf(camera.worldToCamera), eye, 1e-7);
      near(camera.worldToCamera, lookAt(eye, toScene(frame, [x, y, z]), up), 1e-6);
    }),
  );
});

test('theta 0 looks from the +z side of viewer space, theta 90 from the +x side, phi 0 from above', () => {
  near(orbitAxes(0, Math.PI / 2).backward, [0, 0, 1]);
  near(orbitAxes(Math.PI / 2, Math.PI / 2).backward, [1, 0, 0]);
  near(orbitAxes(0, 0).backward, [0, 1, 0]);
  const { right, up, backward } = orbitAxes(1, 0);
  near(cross(right, up), backward);
});

test('the target is in the middle, and up in the scene is up in the frame', () => {
  for (const up of UPS) {
    const frame = viewerFrame(up);
    const camera = cameraOfPose(
      { theta: 1, phi: 1.2, radius: 5, x: 1, y: 2, z: 3, fieldOfView: 0.8 },
      frame,
      320,
      200,
      0.1,
    );
    const target = toScene(frame, [1, 2, 3]);
    near(pixelOf(camera, target), [160, 100, 5]);
    const above: Vector3 = [target[0] + up[0], target[1] + up[1], target[2] + up[2]];
    assert.ok(pixelOf(camera, above)[1] < 100);
  }
});

test("the framing distance makes a ball touch the frame's nearer edge", () => {
  for (const aspect of [0.3, 1, 2.5]) {
    const distance = framingDistance(2, 0.9, aspect);
    const half = Math.min(0.45, Math.atan(Math.tan(0.45) * aspect));
    // The tangent from the eye to the ball makes exactly the half angle with the line of sight.
    assert.ok(Math.abs(Math.asin(2 / distance) - half) < 1e-12);
  }
});

test("the near plane is the trainers' except in small scenes", () => {
  assert.equal(nearPlane({ ...BOUNDS, radius: 100 }), 0.2);
  assert.equal(nearPlane({ ...BOUNDS, radius: 0.5 }), 0.005);
});

test('automatic settings frame the middle of the scene in viewer space', () => {
  const pose = poseOf(settings(), BOUNDS, 1.5);
  near([pose.x, pose.y, pose.z], [1, -3, -3]);
  assert.equal(pose.radius, framingDistance(2, pose.fieldOfView, 1.5));
  const half = poseOf(settings({ cameraOrbit: '0deg 75deg 50%' }), BOUNDS, 1.5);
  assert.ok(Math.abs(half.radius - pose.radius / 2) < 1e-12);
  const given = poseOf(settings({ cameraTarget: 'auto 7 auto', up: 'y' }), BOUNDS, 1.5);
  near([given.x, given.y, given.z], [1, 7, 3]);
});

test('automatic limits are extended to explicit attributes', () => {
  const above = settings({ cameraOrbit: '0deg 0deg 1000m' });
  const camera = new OrbitCamera(poseOf(above, BOUNDS, 1));
  camera.limits = limitsOf(above, BOUNDS, 1);
  assert.deepEqual([camera.goal.phi, camera.goal.radius], [0, 1000]);
});

test('limits of the file replace automatic ones, and are replaced by those of the attributes', () => {
  const bounds = { ...BOUNDS, orbit: { minPhi: 0.8, maxPhi: 1.2, minRadius: 20 } };
  const steered = (given: Parameters<typeof settings>[0]): OrbitCamera => {
    const camera = new OrbitCamera(poseOf(settings(given), bounds, 1));
    camera.limits = limitsOf(settings(given), bounds, 1);
    return camera;
  };
  const camera = steered({});
  // The automatic pose lies within: 75 degrees and the framing distance do not.
  assert.deepEqual([camera.goal.phi, camera.goal.radius], [1.2, 20]);
  camera.orbitBy(0, -9);
  camera.zoomBy(1e-6);
  assert.deepEqual([camera.goal.phi, camera.goal.radius], [0.8, 20]);
  const other = steered({ minCameraOrbit: 'auto 0.5rad 1m', cameraOrbit: '0rad 1.5rad 5m' });
  assert.deepEqual([other.goal.phi, other.goal.radius], [1.5, 5]);
  other.orbitBy(0, -9);
  other.zoomBy(1e-6);
  assert.deepEqual([other.goal.phi, other.goal.radius], [0.5, 1]);
  other.orbitBy(0, 9);
  assert.equal(other.goal.phi, 1.5);
});

test('a smallest radius far beyond the scene does not take the camera out of its range', () => {
  const bounds = { ...BOUNDS, orbit: { minRadius: 1e30 } };
  const { radius } = poseOf(settings({}), bounds, 1);
  assert.equal(radius, limitsOf(settings({}), BOUNDS, 1).max.radius);
});

test('limits hold for gestures', () => {
  const limited = settings({
    minCameraOrbit: '-10deg 60deg 1m',
    maxCameraOrbit: '10deg 80deg 9m',
    cameraOrbit: '0deg 70deg 5m',
  });
  const camera = new OrbitCamera(poseOf(limited, BOUNDS, 1));
  camera.limits = limitsOf(limited, BOUNDS, 1);
  camera.orbitBy(5, 5);
  camera.zoomBy(100);
  const degrees = (angle: number): number => (angle * 180) / Math.PI;
  near([degrees(camera.goal.theta), degrees(camera.goal.phi), camera.goal.radius], [10, 80, 9]);
  camera.orbitBy(-50, -50);
  camera.zoomBy(1e-6);
  near([degrees(camera.goal.theta), degrees(camera.goal.phi), camera.goal.radius], [-10, 60, 1]);
});

test('a pan moves the target with the pointer: its point stays under it', () => {
  const pose: CameraPose = { theta: 0.7, phi: 1.1, radius: 4, x: 0, y: 0, z: 0, fieldOfView: 0.9 };
  const camera = new OrbitCamera(pose);
  const drag = panOf({ x: 10, y: 10 }, { x: 60, y: -20 }, 300);
  assert.equal(drag.type, 'pan');
  if (drag.type === 'pan') camera.panBy(drag.right, drag.up);
  camera.jumpToGoal();
  const frame = viewerFrame([0, 1, 0]);
  near(pixelOf(cameraOfPose(camera.now, frame, 400, 300, 0.1), [0, 0, 0]).slice(0, 2), [200 + 50, 150 - 30], 1e-9);
});

test('gestures', () => {
  const turn = orbitOf({ x: 0, y: 0 }, { x: 128, y: -64 }, 128);
  assert.deepEqual(turn, { type: 'orbit', theta: -2 * Math.PI, phi: Math.PI });
  const [, zoom] = pinchOf(
    [
      { x: 0, y: 0 },
      { x: 10, y: 0 },
    ],
    [
      { x: -5, y: 0 },
      { x: 15, y: 0 },
    ],
    100,
  );
  assert.deepEqual(zoom, { type: 'zoom', factor: 0.5 });
  const factor = (deltaY: number, deltaMode = 0, ctrlKey = false): number => {
    const action = wheelOf({ deltaY, deltaMode, ctrlKey });
    return action.type === 'zoom' ? action.factor : NaN;
  };
  assert.ok(factor(100) > 1 && factor(-100) < 1);
  assert.ok(Math.abs(factor(100) * factor(-100) - 1) < 1e-12);
  assert.equal(factor(1, 1), factor(18));
  assert.ok(factor(1, 0, true) > factor(1));
  assert.equal(factor(1e9), factor(1e6));
  assert.deepEqual(keyOf('ArrowRight', false), { type: 'orbit', theta: Math.PI / 8, phi: 0 });
  assert.deepEqual(keyOf('Home', false), { type: 'reset' });
  assert.equal(keyOf('Tab', false), null);
});

test('a camera that stands still takes no steps', () => {
  const camera = new OrbitCamera(poseOf(settings(), BOUNDS, 1));
  assert.equal(camera.step(16, 50), false);
  camera.orbitBy(1, 0);
  assert.equal(camera.step(16, 50), true);
  let steps = 0;
  while (camera.moving && steps < 1000) {
    camera.step(16, 50);
    steps++;
  }
  assert.ok(steps > 10 && steps < 100, `settled after ${steps} steps`);
  assert.deepEqual(camera.now, camera.goal);
});

test('a new azimuth is reached the short way round', () => {
  const controller = new CameraController(settings({ cameraOrbit: '350deg 75deg auto' }), () => undefined);
  controller.applySettings(settings({ cameraOrbit: '10deg 75deg auto' }));
  controller.step(0, 50);
  for (let now = 16; controller.isMoving; now += 16) {
    controller.step(now, 50);
    const degrees = (controller.orbit.theta * 180) / Math.PI;
    assert.ok(degrees > -11 && degrees < 10.001, `went over ${degrees}`);
  }
  assert.ok(Math.abs((controller.orbit.theta * 180) / Math.PI - 10) < 1e-9);
});

test('who moved the camera', () => {
  const controller = new CameraController(settings(), () => undefined);
  assert.equal(controller.step(0, 0), null);
  controller.frame(BOUNDS);
  assert.equal(controller.step(0, 0), 'automatic');
  assert.equal(controller.step(0, 0), null);
  controller.orbitBy(1, 0);
  assert.equal(controller.step(0, 0), 'user-interaction');
  controller.applySettings(settings({ cameraOrbit: '45deg 75deg auto' }));
  assert.equal(controller.step(0, 0), 'none');
});

test('a new aspect reframes, unless a person has chosen the distance', () => {
  const controller = new CameraController(settings(), () => undefined);
  controller.frame(BOUNDS);
  const { radius } = controller.orbit;
  controller.setAspect(0.5);
  assert.ok(controller.orbit.radius > 1.5 * radius);
  controller.zoomBy(0.9);
  controller.jumpToGoal();
  const chosen = controller.orbit.radius;
  controller.setAspect(2);
  assert.equal(controller.orbit.radius, chosen);
  controller.reset('none');
  controller.jumpToGoal();
  assert.equal(controller.orbit.radius, framingDistance(2, controller.fieldOfView.radians, 2));
});

test('a camera that flies or walks stays in place if the aspect ratio changes', () => {
  const controller = new CameraController(settings(), () => undefined);
  controller.frame(BOUNDS);
  controller.setAspect(2);
  controller.pivot = 'eye';
  const { radius } = controller.orbit;
  controller.setAspect(0.5);
  assert.ok(controller.orbit.radius > 1.5 * radius, 'before a visitor moves it, the scene is framed');
  controller.moveBy(0.1, 0, 0.5);
  controller.lookBy(0.2, 0.1);
  controller.jumpToGoal();
  const eye = eyeOfPose(controller.goal);
  controller.setAspect(2);
  controller.jumpToGoal();
  near(eyeOfPose(controller.goal), eye);
});

test('limits of the target do not hold a walker back, nor do they move it when it looks around', () => {
  const limits = settings({ minCameraTarget: '0m 0m 0m', maxCameraTarget: '1m 1m 1m' });
  const controller = new CameraController(limits, () => undefined);
  controller.frame(BOUNDS);
  controller.pivot = 'eye';
  const eye: Vector3 = [7, 1.6, -3];
  controller.moveEyeTo(eye);
  near(eyeOfPose(controller.goal), eye);
  controller.lookBy(2, 0.4);
  near(eyeOfPose(controller.goal), eye);
  controller.applySettings(limits);
  near(eyeOfPose(controller.goal), eye);
  controller.applySettings({ ...limits, orthographic: true });
  assert.equal(controller.view(30, 20).orthographic, undefined, 'walking has perspective');
  controller.pivot = 'target';
  assert.equal(controller.view(30, 20).orthographic, true);
  controller.orbitBy(0.1, 0);
  const { x, y, z } = controller.goal;
  assert.ok(
    [x, y, z].every((value) => value >= 0 && value <= 1),
    'they apply again to an orbit',
  );
});

test('labels are at the projections of their points, in perspective and in orthographic views', () => {
  const pose: CameraPose = { theta: 0.4, phi: 1.2, radius: 6, x: 1, y: 2, z: 3, fieldOfView: 0.8 };
  const frame = viewerFrame([0, -1, 0]);
  for (const orthographic of [false, true]) {
    const controller = new CameraController(settings({ orthographic }), () => undefined);
    controller.frame(BOUNDS);
    controller.moveTo(pose);
    const camera = controller.view(300, 200);
    const view = new LabelView(camera, frame, 150, 100);
    const towards = (normal: Vector3): boolean => {
      const label = { ...at([0, 0, 0]), normal };
      view.locate(label);
      return label.facesCamera;
    };
    const at = (position: Vector3): Located => ({
      ...{ position, normal: null, x: 0, y: 0, depth: 0, facesCamera: false },
    });
    for (const position of [
      [1, 2, 3],
      [0, 3, 2],
      [2, 1, 4],
    ] as Vector3[]) {
      const label = at(position);
      view.locate(label);
      const expected = project(camera, toScene(frame, position));
      near([label.x, label.y, label.depth], [expected.x / 2, expected.y / 2, expected.depth]);
    }
    const { backward } = orbitAxes(pose.theta, pose.phi);
    assert.deepEqual([towards(backward), towards(backward.map((v) => -v) as unknown as Vector3)], [true, false]);
  }
});

test('the box of a scene has all of its corners, for any up direction', () => {
  const { min, max } = BOUNDS;
  for (const up of UPS) {
    const frame = viewerFrame(up);
    const corners = Array.from({ length: 8 }, (_, k) =>
      toViewer(frame, [0, 1, 2].map((axis) => (k & (1 << axis) ? max : min)[axis]) as unknown as Vector3),
    );
    const found = boxOf(frame, BOUNDS)!;
    for (const [corner, pick] of [
      [found.min, Math.min],
      [found.max, Math.max],
    ] as const)
      near(
        [corner.x, corner.y, corner.z],
        [0, 1, 2].map((axis) => pick(...corners.map((place) => place[axis]))),
      );
  }
});

test('a changed target leaves the orbit where a person has put it', () => {
  const controller = new CameraController(settings(), () => undefined);
  controller.frame(BOUNDS);
  controller.orbitBy(0.5, 0.1);
  controller.jumpToGoal();
  const before = String(controller.orbit);
  controller.applySettings(settings({ cameraTarget: '1 2 3' }));
  controller.jumpToGoal();
  assert.equal(String(controller.orbit), before);
  assert.equal(String(controller.target), '1m 2m 3m');
  assert.ok(dot([1, 0, 0], [controller.target.x, 0, 0]) === 1);
});
