/** The position of a person in a headset: turns, steps and jumps on the floor alone. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Leaving } from '../../packages/element/dist/features/xr/leaving.js';
import { VrRig } from '../../packages/element/dist/features/xr/vr-rig.js';

/** A floor of 4 x 4 m around the origin, at 1 m. */
const side = 80;
const map = {
  ...{ cell: 0.05, corner: [-2, -2] as const, width: side, depth: side, step: 0.3, area: 16 },
  layers: [new Float32Array(side * side).fill(1)],
  start: [0, 1, 0] as const,
};
const identity = Float64Array.from([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);

interface Stick {
  readonly handedness: string;
  /** Null for a hand, which has no gamepad. */
  readonly axes?: readonly number[] | null;
  readonly pressed?: readonly number[];
  /** Matrix of its ray, column-major. */
  readonly ray?: readonly number[];
}

function rigAt(heading = 0, stepsOnly = false, hasMap = true, floor = map) {
  const rig = new VrRig({ eye: [0, 2.6, 0], heading, toViewer: identity, isFloor: true, stepsOnly });
  if (hasMap) rig.map = floor as never;
  /** Position of the head in the space of the session. */
  const place = { x: 0.1, y: 1.6, z: 0.2 };
  /** @returns the position of the head in the scene */
  const frame = (sticks: readonly Stick[] = [], seconds = 0.1): number[] => {
    const { x, y, z } = place;
    const head = { position: place, matrix: Float32Array.from([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1]) };
    const inputSources = sticks.map((stick) => {
      const { handedness, axes = [0, 0, 0, 0], pressed = [], ray } = stick;
      const buttons = Array.from({ length: 6 }, (_, i) => ({ pressed: pressed.includes(i) }));
      return Object.assign(stick, { handedness, targetRaySpace: ray, gamepad: axes && { axes, buttons } });
    });
    const getPose = (ray: readonly number[]) => ({ transform: { matrix: Float32Array.from(ray) } });
    const m = rig.place(
      { session: { inputSources }, getPose } as never,
      { transform: head } as never,
      {} as never,
      seconds,
    );
    // The inverse of a rotation and a translation, at the head.
    const p = [x - m[3], y - m[7], z - m[11]];
    return [0, 1, 2].map((k) => m[k] * p[0] + m[4 + k] * p[1] + m[8 + k] * p[2]);
  };
  return { rig, frame, place };
}

const near = (found: readonly number[], expected: readonly number[], digits = 1e-6): void =>
  assert.ok(
    found.every((value, i) => Math.abs(value - expected[i]) < digits),
    `${found} in place of ${expected}`,
  );

test('the head starts where the camera was, with the floor under the feet', () => {
  near(rigAt().frame(), [0, 2.6, 0]);
  near(rigAt(1).frame(), [0, 2.6, 0]);
});

test('a turn of 30 degrees goes around the head, once for each deflection', () => {
  const { frame } = rigAt();
  const right = [{ handedness: 'right', axes: [0, 0, 1, 0] }];
  for (let i = 0; i < 3; i++) near(frame(right), [0, 2.6, 0]);
  const left = [{ handedness: 'left', axes: [0, 0, 0, -1] }];
  // Ahead of a head that looks to -z, after a turn to the right.
  frame([]);
  const at = frame(left);
  near(at, [0.14 * Math.sin(Math.PI / 6), 2.6, -0.14 * Math.cos(Math.PI / 6)]);
});

test('walking stays on the floor, and not at all for those who ask for less motion', () => {
  const { frame } = rigAt();
  let at: number[] = [];
  for (let i = 0; i < 100; i++) at = frame([{ handedness: 'left', axes: [0, 0, 1, -0.3] }]);
  assert.ok(Math.abs(at[0]) < 2 && Math.abs(at[2]) < 2 && Math.abs(at[1] - 2.6) < 1e-3, String(at));
  near(rigAt(0, true).frame([{ handedness: 'left', axes: [0, 0, 0, -1], ray: rayTo(0) }]), [0, 2.6, 0]);
});

test('the eyes reach their height above a step, also when the stick comes to rest on it', () => {
  const height = (i: number): number => (Math.floor(i / side) < 30 ? 1.25 : 1);
  const steps = { ...map, layers: [Float32Array.from({ length: side * side }, (_, i) => height(i))] };
  const { frame } = rigAt(0, false, true, steps);
  let at = frame();
  while (at[2] > -0.5) at = frame([{ handedness: 'left', axes: [0, 0, 0, -1] }], 0.02);
  assert.ok(at[1] < 2.8, `on the way up, at ${at[1]}`);
  for (let i = 0; i < 40; i++) at = frame([{ handedness: 'left' }], 0.02);
  assert.ok(Math.abs(at[1] - 2.85) < 1e-3, `above the step, at ${at[1]}`);
});

/** From 1.5 m above the floor, ahead and down by 45 degrees to a side. */
const rayTo = (x: number): number[] => {
  const s = Math.SQRT1_2;
  const length = Math.hypot(x, 1, 1);
  void s;
  return [1, 0, 0, 0, 0, 1, 0, 0, -x / length, 1 / length, 1 / length, 0, 0.1, 1.5, 0.2, 1];
};

test('a jump goes to the floor that is aimed at, and nowhere else', () => {
  const { rig, frame } = rigAt();
  const aim = (x: number, pressed: number[]): number[] => frame([{ handedness: 'right', pressed, ray: rayTo(x) }]);
  frame();
  aim(0, [0]);
  assert.ok(rig.target && Math.abs(rig.target[2] + 1.5) < 0.06, String(rig.target));
  near(aim(0, []), [0, 2.6, -1.5], 0.06);
  // Far to the side there is no floor.
  const before = frame();
  aim(3, [0]);
  assert.equal(rig.target, undefined);
  near(aim(3, []), before);
});

test('a hand without a gamepad aims while it pinches, also one that is an input only meanwhile', () => {
  for (const remains of [true, false]) {
    const { rig, frame } = rigAt();
    const hand: Stick = { handedness: 'right', axes: null, ray: rayTo(0) };
    near(frame(remains ? [hand] : []), [0, 2.6, 0]);
    rig.aim(hand as never);
    frame([hand]);
    assert.ok(rig.target, 'the place that is aimed at');
    rig.choose(hand as never);
    near(frame(remains ? [hand] : []), [0, 2.6, -1.5], 0.06);
    near(frame(remains ? [hand] : []), [0, 2.6, -1.5], 0.06);
    assert.equal(rig.target, undefined);
  }
});

test('a controller that vanishes with its trigger held goes nowhere when it comes back', () => {
  const { frame } = rigAt();
  frame([{ handedness: 'right', pressed: [0], ray: rayTo(0) }]);
  frame([]);
  near(frame([{ handedness: 'right', ray: rayTo(0) }]), [0, 2.6, 0]);
});

test('a hand beside a controller of the same side does not release its trigger', () => {
  const { rig, frame } = rigAt();
  const both: Stick[] = [
    { handedness: 'right', pressed: [0], ray: rayTo(0) },
    { handedness: 'right', axes: [], ray: rayTo(0) },
  ];
  for (let i = 0; i < 3; i++) near(frame(both), [0, 2.6, 0]);
  assert.ok(rig.target);
});

test('a map that comes late leaves people where they have gone, and holds from there', () => {
  const { rig, frame } = rigAt(0, false, false);
  frame();
  const ahead = [{ handedness: 'left', axes: [0, 0, 0, -1] }];
  let at: number[] = [];
  for (let i = 0; i < 10; i++) at = frame(ahead);
  near(at, [0, 2.6, -1.4]);
  rig.map = map as never;
  near(frame(), [0, 2.6, -1.4]);
  for (let i = 0; i < 10; i++) at = frame(ahead);
  assert.ok(at[2] > -2, `beyond the floor, at ${at}`);
});

test('steps of their own count: the floor ends where the head is, not where it would be', () => {
  const { frame, place } = rigAt();
  frame();
  place.z -= 1.5;
  near(frame(), [0, 2.6, -1.5]);
  let at: number[] = [];
  for (let i = 0; i < 20; i++) at = frame([{ handedness: 'left', axes: [0, 0, 0, -1] }]);
  assert.ok(at[2] > -2, `beyond the floor, at ${at}`);
});

/** Matrix of a controller at a place of the session's space, column-major. */
const at = (...place: number[]): number[] => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...place, 1];

test('both grips move, turn and scale the scene, whose points stay under the hands', () => {
  for (const stepsOnly of [false, true]) {
    const { rig, frame, place } = rigAt(0.3, stepsOnly, false);
    /** Converts a point of the session's space to the scene. */
    const sceneOf = (m: Float64Array, [x, y, z]: number[]): number[] => {
      const p = [x - m[3], y - m[7], z - m[11]];
      const square = m[0] ** 2 + m[4] ** 2 + m[8] ** 2;
      return [0, 1, 2].map((k) => (m[k] * p[0] + m[4 + k] * p[1] + m[8 + k] * p[2]) / square);
    };
    const hold = (left: number[], right: number[], pressed = [1]): Float64Array => {
      const input = (handedness: string, ray: number[]) => ({
        ...{ handedness, targetRaySpace: at(...ray) },
        gamepad: { axes: [0, 0, 0, 0], buttons: [0, 1, 2, 3, 4, 5].map((i) => ({ pressed: pressed.includes(i) })) },
      });
      return rig.place(
        {
          session: { inputSources: [input('left', left), input('right', right)] },
          getPose: (ray: number[]) => ({ transform: { matrix: Float32Array.from(ray) } }),
        } as never,
        { transform: { position: place, matrix: Float32Array.from(at(place.x, place.y, place.z)) } } as never,
        {} as never,
        0.1,
      );
    };
    const head = frame();
    const [left, right] = [
      [-0.25, 1.25, -0.5],
      [0.25, 1.25, -0.5],
    ];
    const before = hold(left, right);
    const expected = [left, right].map((hand) => sceneOf(before, hand));
    const ends = [
      [0.5, 1.5, -0.5],
      [0.5, 1.5, -1.5],
    ];
    const after = hold(ends[0], ends[1]);
    if (stepsOnly) {
      near(frame(), head);
      continue;
    }
    assert.ok(Math.abs(Math.hypot(after[0], after[4], after[8]) - 2) < 1e-6, 'twice as large');
    ends.forEach((hand, i) => near(sceneOf(after, hand), expected[i], 1e-5));
    near([after[1], after[5] / 2, after[9]], [0, 1, 0]);
    // One grip alone moves nothing, and the stick walks as fast as before.
    const first = sceneOf(hold(ends[0], left, []), [place.x, place.y, place.z]);
    const walking = rig.place(
      { session: { inputSources: [{ handedness: 'left', gamepad: { axes: [0, 0, 0, -1], buttons: [] } }] } } as never,
      { transform: { position: place, matrix: Float32Array.from(at(place.x, place.y, place.z)) } } as never,
      {} as never,
      0.1,
    );
    const then = sceneOf(walking, [place.x, place.y, place.z]);
    assert.ok(Math.abs(2 * Math.hypot(...then.map((value, k) => value - first[k])) - 0.14) < 1e-6, 'speed');
  }
});

test('in a scene of a twentieth of its size, each aim at the floor meets it', () => {
  const { rig, frame } = rigAt();
  const hands = (apart: number): Stick[] => [
    { handedness: 'left', pressed: [1], ray: at(-apart / 2, 1, 0) },
    { handedness: 'right', pressed: [1], ray: at(apart / 2, 1, 0) },
  ];
  frame();
  frame(hands(1));
  frame(hands(0.05));
  // The floor is 20 cm wide, 5 cm below the hands.
  for (let z = -0.08; z < 0.08; z += 0.005) {
    const back = [0, 0.55, 0.3 - z].map((value) => value / Math.hypot(0.55, 0.3 - z));
    frame([{ handedness: 'right', pressed: [0], ray: [1, 0, 0, 0, 0, 1, 0, 0, ...back, 0, 0, 1.5, 0.3, 1] }]);
    assert.ok(rig.target && Math.abs(rig.target[1] - 1) < 1e-6, `aim at ${z}: ${rig.target}`);
  }
});

test('a stick that is pushed forward aims, and goes there when it is let go; the left one walks', () => {
  const { rig, frame } = rigAt();
  const right = (x: number, y: number): number[] => frame([{ handedness: 'right', axes: [0, 0, x, y], ray: rayTo(0) }]);
  frame();
  right(0, -0.9);
  assert.ok(rig.target && Math.abs(rig.target[2] + 1.5) < 0.06, String(rig.target));
  right(0, -0.4);
  assert.ok(rig.target, 'still aims on its way back');
  near(right(0, 0), [0, 2.6, -1.5], 0.06);
  assert.equal(rig.target, undefined);
  near(right(0, 0), [0, 2.6, -1.5], 0.06);
  // A stick to the side turns alone.
  right(0.9, -0.8);
  assert.equal(rig.target, undefined);
  const steps = rigAt(0, true);
  const left = (y: number): number[] => steps.frame([{ handedness: 'left', axes: [0, 0, 0, y], ray: rayTo(0) }]);
  steps.frame();
  left(-1);
  near(left(0), [0, 2.6, -1.5], 0.06);
});

interface Input {
  readonly gamepad?: object;
  readonly targetRayMode?: string;
}

function session(inputs: Input[]) {
  const target = Object.assign(new EventTarget(), {
    inputSources: inputs,
    left: 0,
    end: () => (target.left++, Promise.resolve()),
  });
  const leaving = new Leaving(target as never, new AbortController().signal);
  const send = (type: string, inputSource: Input) =>
    target.dispatchEvent(Object.assign(new Event(type), { inputSource }));
  const wait = (frames: number): void => {
    for (let i = 0; i < frames; i++) leaving.advance(0.1);
  };
  return { target, leaving, send, wait };
}

test('the button that leaves is held for a second, and ends the session once', () => {
  const pad = { buttons: Array.from({ length: 6 }, () => ({ pressed: false })) };
  const { target, wait } = session([{ gamepad: pad }]);
  const press = (pressed: boolean) => (pad.buttons[5].pressed = pressed);
  press(true);
  wait(8);
  press(false);
  wait(1);
  press(true);
  wait(8);
  assert.equal(target.left, 0);
  wait(20);
  assert.equal(target.left, 1);
});

test('both hands that pinch for two seconds leave, and go nowhere; two fingers on a screen do not', () => {
  const hands = [{ targetRayMode: 'tracked-pointer' }, { targetRayMode: 'tracked-pointer' }];
  const { target, leaving, send, wait } = session(hands);
  send('selectstart', hands[0]);
  wait(30);
  assert.ok(target.left === 0 && !leaving.isGesture, 'one hand aims');
  send('selectstart', hands[1]);
  wait(10);
  send('selectend', hands[0]);
  wait(1);
  assert.ok(target.left === 0 && leaving.isGesture, 'the other hand, until it opens');
  send('selectend', hands[1]);
  wait(1);
  assert.ok(!leaving.isGesture);
  hands.forEach((hand) => send('selectstart', hand));
  wait(21);
  assert.equal(target.left, 1);
  const fingers = [{ targetRayMode: 'screen' }, { targetRayMode: 'screen' }];
  const phone = session(fingers);
  fingers.forEach((finger) => phone.send('selectstart', finger));
  phone.wait(50);
  assert.equal(phone.target.left, 0);

  const { rig, frame } = rigAt();
  const hand: Stick = { handedness: 'right', axes: null, ray: rayTo(0) };
  frame([hand]);
  rig.aim(hand as never);
  frame([hand]);
  rig.choose(hand as never, true);
  near(frame([hand]), [0, 2.6, 0]);
});
