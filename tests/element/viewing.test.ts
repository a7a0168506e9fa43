import assert from 'node:assert/strict';
import { test } from 'node:test';
import fc from 'fast-check';
import type { Camera } from '@gaussian-splat/core';

interface Spoken {
  readonly VIEW_NAMES: readonly string[];
  viewName(theta: number, phi: number): string;
}
interface Words {
  readSpokenStrings(value: unknown): object | null;
}
interface Projection {
  project(camera: Camera, point: readonly [number, number, number]): { x: number; y: number; depth: number };
  unproject(camera: Camera, place: { x: number; y: number; depth: number }): readonly [number, number, number];
}
interface OrbitModule {
  cameraOfPose(pose: object, frame: object, width: number, height: number, near: number): Camera;
  viewerFrame(up: readonly number[]): object;
  eyeOfPose(pose: object): readonly [number, number, number];
}
interface OrbitCameraModule {
  OrbitCamera: new (pose: object) => {
    now: Readonly<Record<string, number>>;
    goal: Readonly<Record<string, number>>;
    moving: boolean;
    pivot: string;
    lookBy(theta: number, phi: number): void;
    turnBy(theta: number): void;
    step(stepMs: number, decayMs: number): boolean;
  };
}

const load = <T>(name: string): Promise<T> =>
  import(`../../packages/element/dist/viewer/camera/${name}.js`) as unknown as Promise<T>;
const degrees = (value: number): number => (value * Math.PI) / 180;
const finite = (limit: number): fc.Arbitrary<number> => fc.double({ min: -limit, max: limit, noNaN: true });
const pose = fc.record({
  ...{ theta: finite(10), phi: fc.double({ min: 0.01, max: 3.13, noNaN: true }) },
  ...{ radius: fc.double({ min: 0.1, max: 100, noNaN: true }), x: finite(50), y: finite(50), z: finite(50) },
  fieldOfView: fc.double({ min: 0.1, max: 2.5, noNaN: true }),
});

test('names of views: quarters around, thirds from above to below, any number of turns', async () => {
  const { viewName, VIEW_NAMES } = await load<Spoken>('spoken');
  assert.equal(viewName(0, degrees(90)), 'front');
  assert.equal(viewName(degrees(90), degrees(90)), 'right');
  assert.equal(viewName(degrees(-90), degrees(90)), 'left');
  assert.equal(viewName(degrees(180), degrees(30)), 'upper-back');
  assert.equal(viewName(degrees(44), degrees(150)), 'lower-front');
  fc.assert(
    fc.property(finite(1e4), fc.double({ min: 0, max: Math.PI, noNaN: true }), (theta, phi) => {
      assert.ok(VIEW_NAMES.includes(viewName(theta, phi)));
    }),
  );
});

test('words of the page: JSON or an object; anything else is malformed', async () => {
  const { readSpokenStrings } = await load<Words>('../strings');
  assert.deepEqual(readSpokenStrings('{"front": "vorn", "back": 7}'), { front: 'vorn' });
  assert.deepEqual(readSpokenStrings(null), {});
  for (const malformed of ['{', '[]', '7', 'null', 7])
    assert.equal(readSpokenStrings(malformed), null, String(malformed));
});

test('what is projected comes back from its pixel and its depth', async () => {
  const { project, unproject } = await load<Projection>('projection');
  const { cameraOfPose, viewerFrame } = await load<OrbitModule>('orbit');
  fc.assert(
    fc.property(
      pose,
      fc.constantFrom([0, 1, 0], [0, -1, 0], [1, 0, 0], [0.48, -0.6, 0.64]),
      fc.tuple(finite(640), finite(480), fc.double({ min: 0.1, max: 100, noNaN: true })),
      (p, up, [x, y, depth]) => {
        const camera = cameraOfPose(p, viewerFrame(up), 640, 480, 0.1);
        const back = project(camera, unproject(camera, { x, y, depth }));
        assert.ok(Math.abs(back.depth - depth) < 1e-9 * (1 + depth) * 1e3, `${back.depth} for ${depth}`);
        assert.ok(Math.hypot(back.x - x, back.y - y) < 1e-5, `${back.x}, ${back.y} for ${x}, ${y}`);
      },
    ),
  );
});

test('a camera that flies keeps its eye all the way while it looks around, and comes to rest exactly at its goal', async () => {
  const { OrbitCamera } = await load<OrbitCameraModule>('orbit-camera');
  const { eyeOfPose } = await load<OrbitModule>('orbit');
  fc.assert(
    fc.property(pose, finite(2), finite(1), (start, theta, phi) => {
      const camera = new OrbitCamera(start);
      camera.pivot = 'eye';
      const eye = eyeOfPose(camera.now);
      camera.lookBy(theta, phi);
      for (let i = 0; i < 2000 && camera.moving; i++) {
        camera.step(16, 50);
        const now = eyeOfPose(camera.now);
        assert.ok(Math.hypot(...now.map((v, axis) => v - eye[axis])) < 1e-9 * (1 + start.radius), `${now.join()}`);
      }
      assert.ok(!camera.moving, 'the motion ends');
      // The start may be an object without a prototype, and -0 is 0.
      const numbers = (one: object): object => Object.fromEntries(Object.entries(one).map(([k, v]) => [k, v + 0]));
      assert.deepEqual(numbers(camera.now), numbers(camera.goal));
    }),
  );
});

test('a flying camera turns about its eye, at rest and in motion', async () => {
  const { OrbitCamera } = await load<OrbitCameraModule>('orbit-camera');
  const { eyeOfPose } = await load<OrbitModule>('orbit');
  fc.assert(
    fc.property(pose, finite(2), fc.boolean(), (start, theta, isOnItsWay) => {
      const camera = new OrbitCamera(start);
      camera.pivot = 'eye';
      const eye = eyeOfPose(camera.now);
      if (isOnItsWay) camera.lookBy(1, 0);
      const before = camera.now.theta;
      camera.turnBy(theta);
      assert.ok(Math.abs(camera.now.theta - before - theta) < 1e-9, 'it turns');
      const now = eyeOfPose(camera.now);
      assert.ok(Math.hypot(...now.map((v, axis) => v - eye[axis])) < 1e-9 * (1 + start.radius), `${now.join()}`);
      assert.equal(camera.moving, isOnItsWay, 'it rests as before');
    }),
  );
});
