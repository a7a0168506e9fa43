/** The parts of walking that need no page: a body that is put down, and the sticks of gamepads. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Gamepads, FloorBody } from '../support/element/parts.js';

/** Two floors of 4 x 4 m around the origin, at 0 m and, in its half with positive x, at 2 m. */
const side = 80;
const map = {
  ...{ cell: 0.05, corner: [-2, -2] as const, width: side, depth: side, step: 0.3, area: 16 },
  layers: [
    new Float32Array(side * side),
    Float32Array.from({ length: side * side }, (_, i) => (i % side < side / 2 ? NaN : 2)),
  ],
  start: [0.5, 0, 0.5] as const,
};

test('a body is put on the highest floor below a point, and stays where there is none', async () => {
  const walker = new FloorBody(map, [-1, 1.6, -1]);
  assert.deepEqual([walker.at, walker.eyeFloor], [[-1, 0, -1], 0]);
  assert.equal(await walker.goTo([-1, 0, 1]), true);
  assert.equal(walker.isMoving, true);
  walker.land([1, 3.6, 1]);
  assert.deepEqual([walker.at, walker.eyeFloor, walker.isMoving], [[1, 2, 1], 2, false]);
  walker.land([9, 1.6, 0]);
  assert.deepEqual(walker.at, [1, 2, 1]);
  assert.deepEqual(new FloorBody(map, [9, 1.6, 0]).at, map.start);
});

test('another motion ends the search for a path', async () => {
  const walker = new FloorBody(map, [-1, 1.6, -1]);
  const going = walker.goTo([-1, 0, 1]);
  walker.step(0.1, 1, 0);
  assert.equal(await going, false);
  const { at } = walker;
  walker.step(0.1, 0, 0);
  assert.deepEqual(walker.at, at);
});

test('a body looks along the length of its floor, unless the camera looks far already', () => {
  /** A corridor of 8 x 1 m along x, whose columns in `gap` have no floor. */
  const corridor = (gap: readonly number[] = []) => ({
    ...{ cell: 0.1, corner: [-4, -0.5] as const, width: 80, depth: 10, step: 0.3, area: 8 },
    layers: [Float32Array.from({ length: 800 }, (_, i) => (gap.includes(i % 80) ? NaN : 0))],
    start: [-2, 0, 0] as const,
  });
  const open = (floor: ReturnType<typeof corridor>, theta: number): number =>
    new FloorBody(floor, [-2, 1.6, 0]).openDirection(theta) % (2 * Math.PI);
  // A camera of azimuth 0 looks to -z, one of -90 degrees to +x.
  assert.ok(Math.abs(open(corridor(), 0) - 1.5 * Math.PI) < 1e-6, `${open(corridor(), 0)}`);
  assert.equal(open(corridor(), -Math.PI / 2), -Math.PI / 2);
  // A step without floor ends the view, and the other way is longer then.
  assert.ok(Math.abs(open(corridor([25, 26, 27]), 0) - Math.PI / 2) < 1e-6);
  // A camera that faces +z from the middle of a corridor along x turns to the end on its side, not to the farther one.
  const middle = new FloorBody(corridor(), [0.5, 1.6, 0]);
  for (const [theta, side] of [
    [0.9 * Math.PI, 1],
    [1.1 * Math.PI, -1],
  ])
    // prettier-ignore
    assert.ok(Math.abs(Math.sin(middle.openDirection(theta)) - side) < 0.02, `${theta}`);
});

interface Pad {
  readonly axes: readonly number[];
  readonly mapping: string;
}

function sticksOf(pads: readonly (Pad | null)[]): { gamepads: Gamepads; frame(): boolean } {
  const view = Object.assign(new EventTarget(), {
    navigator: { getGamepads: () => pads },
    frames: [] as (() => void)[],
    requestAnimationFrame: (callback: () => void) => view.frames.push(callback),
  });
  let isDeflected = false;
  const gamepads = new Gamepads(view as never, () => (isDeflected = true));
  gamepads.listen(new AbortController().signal);
  return {
    gamepads,
    frame() {
      isDeflected = false;
      for (const callback of view.frames.splice(0)) callback();
      return isDeflected;
    },
  };
}

test('the left stick walks and the right one turns; sticks at rest, triggers and missing axes do neither', () => {
  const standard = sticksOf([null, { axes: [0.5, -1, 0.7, 0.05], mapping: 'standard' }]);
  assert.equal(standard.frame(), true);
  assert.deepEqual(standard.gamepads.deflection, [0.5, 1, -0.7]);
  const still = sticksOf([
    { axes: [0.1, -0.1, 0.14, 0], mapping: 'standard' },
    { axes: [], mapping: '' },
  ]);
  assert.equal(still.frame(), false);
  assert.deepEqual(still.gamepads.deflection, [0, 0, 0]);
  // Axis 2 of many pads without the standard mapping is a trigger at rest.
  assert.equal(sticksOf([{ axes: [0, 0, -1, 0, 0, -1], mapping: '' }]).frame(), false);
});

test('a page whose permissions policy forbids gamepads walks without them', () => {
  const getGamepads = (): never => {
    throw new DOMException('disallowed by permissions policy', 'SecurityError');
  };
  const gamepads = new Gamepads(Object.assign(new EventTarget(), { navigator: { getGamepads } }) as never, () =>
    assert.fail('deflected'),
  );
  gamepads.listen(new AbortController().signal);
  assert.deepEqual(gamepads.deflection, [0, 0, 0]);
});
