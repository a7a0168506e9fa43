/**
 * Views in all the forms that pages and files have them, and the ways between them.
 * SECURITY.md: "The page keeps working".
 */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { cross, dot, eyeOf, lookAt, type Bounds, type Vector3 } from '@gaussian-splat/core';
import fc from 'fast-check';
import {
  cameraOfPose,
  eyeOfPose,
  orbitAxes,
  toScene,
  toViewer,
  viewerFrame,
  type CameraPose,
  fieldOfViewGrammar,
  orbitGrammar,
  targetGrammar,
  poseOf,
  CameraController,
  poseOfView,
  type CameraView,
  type ViewContext,
  easingOf,
  pathThrough,
  unwound,
  readViews,
} from '../support/element/camera.js';
import { ATTRIBUTES, Flight } from '../support/element/parts.js';
import { settings } from '../support/camera-settings.js';
import { needsSharedData, sharedFile } from '../support/data.js';

const BOUNDS: Bounds = { min: [0, 1, 2], max: [2, 5, 4], center: [1, 3, 3], radius: 2 };
const UP: Vector3 = [0, -1, 0];

function context(up = UP, aspect = 1.5): ViewContext {
  const frame = viewerFrame(up);
  const given = settings({ up: up.join(' ') });
  return { settings: given, bounds: BOUNDS, frame, aspect, from: poseOf(given, BOUNDS, aspect) };
}

const near = (actual: readonly number[], expected: readonly number[], what: string, tolerance = 1e-9): void =>
  actual.forEach((value, i) =>
    assert.ok(Math.abs(value - expected[i]) <= tolerance, `${what} ${i}: ${value} is not ${expected[i]}`),
  );

const forwardOf = ({ theta, phi }: CameraPose): Vector3 =>
  orbitAxes(theta, phi).backward.map((v) => -v) as unknown as Vector3;

test('words of the attributes: what is left out stays, percents and auto mean what they mean there', () => {
  const given = context();
  const { from } = given;
  const turned = poseOfView({ orbit: '90deg 60deg 50%' }, given);
  near([turned.theta, turned.phi, turned.radius], [Math.PI / 2, Math.PI / 3, from.radius / 2], 'orbit');
  assert.deepEqual([turned.x, turned.y, turned.z, turned.fieldOfView], [from.x, from.y, from.z, from.fieldOfView]);
  const aimed = poseOfView({ target: '1m 2m auto', fieldOfView: '30deg' }, given);
  assert.deepEqual([aimed.x, aimed.y, aimed.z], [1, 2, from.z]);
  assert.deepEqual([aimed.theta, aimed.radius], [from.theta, from.radius]);
  near([aimed.fieldOfView], [Math.PI / 6], 'field of view');
});

test('a camera of a trainer, and its matrix, have their eye and their direction, for any up direction', () => {
  const point = fc.tuple(
    ...[0, 1, 2].map(() => fc.double({ min: -9, max: 9, noNaN: true })),
  ) as unknown as fc.Arbitrary<Vector3>;
  fc.assert(
    fc.property(
      point,
      point,
      fc.constantFrom<Vector3>([0, -1, 0], [0, 1, 0], [0, 0, 1], [0.6, 0, 0.8]),
      (eye, target, up) => {
        const way = target.map((v, i) => v - eye[i]) as unknown as Vector3;
        fc.pre(Math.hypot(...way) > 0.1 && Math.hypot(...cross(way, up)) > 0.1);
        const m = lookAt(eye, target, up);
        const rotation = [0, 1, 2].map((row) => [m[row], m[4 + row], m[8 + row]]);
        const given = context(up);
        for (const view of [
          { position: [...eye], rotation, width: 1600, height: 900, fx: 1000, fy: 1000 },
          {
            worldToCamera: [...m],
            K: [
              [1000, 0, 800],
              [0, 1000, 450],
              [0, 0, 1],
            ],
            height: 900,
          },
          { worldToCamera: [0, 1, 2, 3].map((row) => [...m].slice(4 * row, 4 * row + 4)) },
        ] as CameraView[]) {
          const pose = poseOfView(view, given);
          near(toScene(given.frame, eyeOfPose(pose)), eye, 'eye', 1e-6);
          near(
            toScene(given.frame, forwardOf(pose)),
            way.map((v) => v / Math.hypot(...way)),
            'direction',
            1e-6,
          );
          const angle = 'worldToCamera' in view && !view.K ? given.from.fieldOfView : 2 * Math.atan(0.45);
          near([pose.fieldOfView], [angle], 'field of view');
        }
      },
    ),
  );
});

test('the cameras of a training, from the file', { skip: needsSharedData }, () => {
  const cameras = JSON.parse(Buffer.from(sharedFile('photos/skull/cameras.json')).toString()) as {
    img_name: string; position: number[]; rotation: number[][]; width: number; height: number; fx: number; fy: number;
  }[]; // prettier-ignore
  const { views, path } = readViews(cameras);
  assert.deepEqual([views.length, path.length, views[0].name], [cameras.length, 0, cameras[0].img_name]);
  const given = context();
  views.forEach(({ view }, i) => {
    const { position, rotation, width, height, fy } = cameras[i];
    const pose = poseOfView(view, given);
    const camera = cameraOfPose(pose, given.frame, width, height, 0.01);
    near(eyeOf(camera.worldToCamera), position, 'eye', 1e-6);
    near(
      [...camera.worldToCamera].slice(8, 11),
      rotation.map((row) => row[2]),
      'direction',
      1e-6,
    );
    near([camera.fy], [fy], 'focal length', 1e-6);
  });
});

/** As the viewer of SuperSplat writes it. Its space is the file's, turned by half a turn around z. */
const SUPERSPLAT = {
  version: 2,
  cameras: [{ initial: { position: [2, 1, 5], target: [0, 1, 0], fov: 60 } }],
  annotations: [
    { position: [0, 0, 0], title: 'Door', text: '', camera: { initial: { position: [0, 1, 3], target: [0, 1, 0], fov: 40 } } },
  ],
  animTracks: [
    { name: 'cameraAnim', duration: 4, frameRate: 30, keyframes: { times: [0, 60, 120], values: { position: [0, 1, 3, 3, 1, 0, 0, 1, -3], target: [0, 1, 0, 0, 1, 0, 0, 1, 0], fov: [40, 50, 60] } } },
  ],
}; // prettier-ignore

test("the settings of SuperSplat's viewer, both versions: cameras, annotations, and a path with its times", () => {
  const { views, path } = readViews(SUPERSPLAT);
  assert.deepEqual(views.map(({ name }) => name), ['1', 'Door']); // prettier-ignore
  assert.deepEqual(path.map(({ time }) => time), [0, 2, 4]); // prettier-ignore
  for (const up of [UP, [0, 0, 1]] as Vector3[]) {
    const given = context(up, 2);
    const pose = poseOfView(views[0].view, given);
    near(toScene(given.frame, eyeOfPose(pose)), [-2, -1, 5], 'eye in the frame of the file');
    near(toScene(given.frame, [pose.x, pose.y, pose.z]), [-0, -1, 0], 'target');
    near([Math.tan(pose.fieldOfView / 2) * 2], [Math.tan(Math.PI / 6)], 'the angle is along the longer side');
    near([poseOfView(views[0].view, { ...given, aspect: 0.5 }).fieldOfView], [Math.PI / 3], 'upright');
  }
  const first = { camera: { fov: 75, position: [0, 1, 3], target: [0, 1, 0], startAnim: 'none' }, background: { color: [0, 0, 0] }, animTracks: [] }; // prettier-ignore
  assert.deepEqual(readViews(first).views.length, 1);
  const early = { camera: { fov: 60 }, animTracks: [{ keyframes: { times: [0, 1.5], values: { position: [0, 0, 3, 1, 0, 3], target: [0, 0, 0, 0, 0, 0] } } }] }; // prettier-ignore
  assert.deepEqual(readViews(early).path.map(({ time }) => time), [0, 1.5]); // prettier-ignore
});

test('what is none says what was expected and what was found', () => {
  const given = context();
  for (const [view, words] of [
    [{}, /none of these/],
    [{ orbit: 'over there' }, /over there/],
    [{ position: [1, 2], rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }, /three numbers/], // prettier-ignore
    [{ position: [1, 2, 3], rotation: [1, 0, 0] }, /3x3/],
    [{ worldToCamera: [1, 2, 3] }, /4x4/],
    [{ position: [1, 2, 3], lookAt: [1, 2, 3] }, /another point/],
    [null, /found null/],
  ] as const) {
    assert.throws(
      () => poseOfView(view as unknown as CameraView, given),
      (error: Error & { code: string }) => error.code === 'argument/camera' && words.test(error.message),
      JSON.stringify(view),
    );
  }
  for (const list of ['text', 5, { scenes: [] }, [5]]) {
    assert.throws(() => readViews(list), { code: 'argument/camera' }, JSON.stringify(list));
  }
  assert.throws(() => poseOfView(readViews([{ name: 'empty' }]).views[0].view, given), { code: 'argument/camera' });
});

const pose = (theta: number, radius: number, x = 0): CameraPose => ({
  theta,
  phi: 1.3,
  radius,
  x,
  y: 0,
  z: 0,
  fieldOfView: 0.8,
});

test('a path passes through its views at their times, is smooth there, and turns the short way', () => {
  const poses = [pose(0, 1), pose(6, 4, 1), pose(1, 2, 3), pose(1, 2, 3)];
  const times = [0, 1, 4, 5];
  times.forEach((time, i) => {
    const there = pathThrough(poses, times)(time);
    near([Math.cos(there.theta), Math.sin(there.theta), there.radius, there.x], [Math.cos(poses[i].theta), Math.sin(poses[i].theta), poses[i].radius, poses[i].x], `${time} s`, 1e-12); // prettier-ignore
  });
  const step = 1e-4;
  for (let time = step; time < 5 - step; time += 0.01) {
    const [a, b, c] = [time - step, time, time + step].map((at) => pathThrough(poses, times)(at));
    assert.ok(Math.abs(b.theta - a.theta) < 10 * step, `${time}: no leap`);
    assert.ok(Math.abs(a.x - 2 * b.x + c.x) < 1e-4 * 0.1, `${time}: no corner`);
    assert.ok(b.radius > 0);
  }
  near([pathThrough([pose(0, 1), pose(0, 4)], [0, 1])(0.5).radius], [2], 'distances go by factors');
  assert.deepEqual([pathThrough(poses, times)(-3), pathThrough([poses[0]], [7])(9)], [poses[0], poses[0]]);
  near([unwound(pose(6, 1), pose(0, 1)).theta], [6 - 2 * Math.PI], 'turns');
});

test('easings begin at 0, end at 1 and never go back', () => {
  for (const name of ['linear', 'ease-in', 'ease-out', 'ease-in-out'] as const) {
    const ease = easingOf(name);
    assert.deepEqual([ease(0), ease(1)], [0, 1]);
    for (let t = 0; t < 1; t += 0.01) assert.ok(ease(t + 0.01) >= ease(t), name);
  }
  assert.equal(easingOf((t) => t / 2)(1), 0.5);
});

function framed(): CameraController {
  const camera = new CameraController(settings(), () => undefined);
  camera.frame(BOUNDS);
  camera.step(0, 0);
  return camera;
}

test('a flight arrives at its end, and is interrupted by camera input, but not by a new aspect ratio', async (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const way = (camera: CameraController) => {
    const from = camera.goal;
    return (ms: number): CameraPose => ({ ...from, theta: Math.min(1, ms / 1000), radius: 6 });
  };
  const camera = framed();
  const flight = new Flight(camera, way(camera), 1000);
  for (const now of [100, 600]) flight.advance(now);
  assert.equal(camera.orbit.theta, 0.5);
  camera.setAspect(0.5);
  flight.advance(900);
  assert.deepEqual([camera.orbit.theta, camera.orbit.radius, flight.isOver], [0.8, 6, false]);
  flight.advance(1200);
  assert.deepEqual([camera.orbit.theta, await flight.finished], [1, true]);

  for (const move of [
    (one: CameraController) => one.orbitBy(0.1, 0),
    (one: CameraController) => one.applySettings(settings({ cameraOrbit: '5deg 75deg 3m' })),
    (one: CameraController) => one.reset('none'),
  ]) {
    const taken = framed();
    const given = new Flight(taken, way(taken), 1000);
    for (const now of [0, 500]) given.advance(now);
    move(taken);
    const { theta } = taken.goal;
    given.advance(600);
    assert.deepEqual([taken.goal.theta, await given.finished], [theta, false]);
  }
  // No frame is drawn off-screen.
  const unseen = framed();
  const timed = new Flight(unseen, way(unseen), 1000);
  t.mock.timers.tick(1200);
  assert.deepEqual([unseen.orbit.theta, await timed.finished], [1, true]);
});

test('a flight goes where automatic limits would not let hands go, but not beyond those of the page', () => {
  const above = { ...framed().goal, phi: 0.05, radius: 500 };
  const free = framed();
  free.moveTo(above);
  assert.deepEqual([free.orbit.phi, free.orbit.radius], [0.05, 500]);
  free.reset('none');
  free.jumpToGoal();
  free.orbitBy(0, -3);
  free.jumpToGoal();
  assert.ok(free.orbit.phi > 0.39, 'hands are held again');
  const limited = new CameraController(settings({ minCameraOrbit: 'auto 40deg auto' }), () => undefined);
  limited.frame(BOUNDS);
  limited.moveTo(above);
  near([limited.orbit.phi], [(40 * Math.PI) / 180], 'phi');
});

test('a view straight down or up keeps the azimuth', () => {
  const given = context();
  const from = { ...given.from, theta: 0.7 };
  for (const y of [9, -9]) {
    const pose = poseOfView({ position: [1, y, 3], lookAt: [1, 3, 3] }, { ...given, from });
    near([pose.theta, pose.phi], [0.7, y > 3 ? 0 : Math.PI], 'angles');
    // A matrix in float32 is vertical only nearly.
    const almost = poseOfView({ position: [1 + 1e-8, y, 3 - 1e-8], lookAt: [1, 3, 3] }, { ...given, from });
    near([almost.theta], [0.7], 'azimuth');
  }
});

test('eyes and targets in viewer space', () => {
  const given = context();
  const pose = poseOfView({ position: [1, 2, 6], lookAt: [1, 2, 1] }, given);
  near([pose.theta, pose.phi, pose.radius, pose.x, pose.y, pose.z], [0, Math.PI / 2, 5, 1, 2, 1], 'pose');
  near(toViewer(given.frame, [0, 1, 0]), [0, -1, 0], 'y up');
  assert.ok(dot(forwardOf(pose), [0, 0, -1]) > 0.999);
});

test('a path of many keyframes costs each frame next to nothing, however wound it is', () => {
  const count = 40_000;
  const poses = Array.from({ length: count }, (_, k) => pose(3 * k, 1 + (k % 7)));
  const times = poses.map((_, k) => k / 30);
  const before = process.cpuUsage();
  const along = pathThrough(poses, times);
  for (let frame = 0; frame < 1_000; frame++) along((frame * count) / 30_000);
  const { user } = process.cpuUsage(before);
  assert.ok(user < 1e6, `${user / 1e3} ms for the path and a thousand frames`);
});

test('third-party views: long numbers are read in linear time', () => {
  const before = process.cpuUsage();
  for (const grammar of [orbitGrammar('auto'), targetGrammar, fieldOfViewGrammar, ATTRIBUTES.detail.grammar!])
    assert.equal(grammar.parse(`${'9'.repeat(200_000)}!`), null);
  const { user } = process.cpuUsage(before);
  assert.ok(user < 0.5e6, `${user / 1e3} ms`);
});
