/** Automatic camera motion, at the camera's limits and while a scene loads in parts. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Bounds } from '@gaussian-splat/core';
import { type RawAttributes, AutoRotateController, PromptController } from '../support/element/parts.js';
import { CameraController } from '../support/element/camera.js';
import { settings } from '../support/camera-settings.js';
import { viewerOf } from '../support/viewer.js';

const BOUNDS: Bounds = { min: [-1, -1, -1], max: [1, 1, 1], center: [0, 0, 0], radius: 2 };
const degrees = Math.PI / 180;

function framed(changes: Partial<RawAttributes> = {}): CameraController {
  const camera = new CameraController(settings(changes), () => undefined);
  camera.frame(BOUNDS);
  camera.step(0, 0);
  return camera;
}

function rotating(camera: CameraController, rotationPerSecond = 100 * degrees): AutoRotateController {
  const attributes = { autoRotate: true, autoRotateDelay: 0, rotationPerSecond };
  const controller = new AutoRotateController(viewerOf({ camera, attributes }));
  controller.start();
  return controller;
}

test('auto-rotation turns back at the limits, and stops where it may go nowhere', () => {
  const camera = framed({ minCameraOrbit: '-10deg auto auto', maxCameraOrbit: '10deg auto auto' });
  const controller = rotating(camera);
  const seen: number[] = [];
  for (let now = 0; now < 2000; now += 16) {
    assert.equal(controller.advance(now), true);
    assert.equal(camera.step(now, 0) !== null || now === 0, true, 'each frame shows something else');
    seen.push(camera.orbit.theta / degrees);
  }
  assert.ok(Math.min(...seen) < -9.9 && Math.max(...seen) > 9.9, 'from limit to limit');
  assert.ok(Math.min(...seen) >= -10.001 && Math.max(...seen) <= 10.001);

  const fixed = framed({ minCameraOrbit: '5deg auto auto', maxCameraOrbit: '5deg auto auto' });
  const stuck = rotating(fixed);
  stuck.advance(0);
  assert.equal(stuck.advance(16), false, 'it continues although nothing moves');
  assert.equal(fixed.step(16, 0), null);
});

test('auto-rotation at a speed of 0 asks for no frames', () => {
  const controller = rotating(framed(), 0);
  assert.deepEqual(
    [0, 16, 32].map((now) => controller.advance(now)),
    [false, false, false],
  );
});

test('the prompt leaves the camera where it was, at a limit too', (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  for (const limits of [{}, { maxCameraOrbit: '2deg auto auto' }, { minCameraOrbit: '-1deg auto auto' }]) {
    const camera = framed(limits);
    const attributes = {
      interactionPrompt: 'auto',
      interactionPromptStyle: 'wiggle',
      interactionPromptThreshold: 10,
    };
    const prompt = new PromptController(viewerOf({ camera, attributes, input: { enabled: true } }));
    prompt.hostUpdated();
    t.mock.timers.tick(20);
    let farthest = 0;
    for (let now = 0; prompt.advance(now); now += 16) {
      camera.step(now, 0);
      farthest = Math.max(farthest, Math.abs(camera.orbit.theta));
    }
    assert.ok(farthest > 5 * degrees, 'it wiggles');
    assert.ok(Math.abs(camera.orbit.theta) < 1e-9, `${JSON.stringify(limits)}: ${camera.orbit.theta}`);
    // Otherwise no other element of the page prompts.
    prompt.hostDisconnected();
  }
});

test('more of a scene changes the distance, not what has been turned meanwhile', () => {
  const camera = framed();
  camera.turnBy(-0.7);
  camera.step(16, 0);
  const { radius } = camera.orbit;
  camera.refine({ ...BOUNDS, radius: 4 });
  camera.jumpToGoal();
  assert.ok(camera.orbit.radius > 1.5 * radius);
  assert.ok(Math.abs(camera.orbit.theta + 0.7) < 1e-9, `${camera.orbit.theta}`);
  camera.frame(BOUNDS);
  assert.ok(Math.abs(camera.orbit.theta) < 1e-9, 'another scene is seen from where the attributes say');
});
