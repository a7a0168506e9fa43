import assert from 'node:assert/strict';
import { test } from 'node:test';
import { DoubleTap } from '../support/element/camera.js';

/** Down and up of each tap: time, duration, position, how far the finger slides, whether another is down, whether the browser takes it. */
type Tap = [ms: number, x: number, more?: { rest?: number; slide?: number; alone?: boolean; taken?: boolean }];

function doubles(taps: readonly Tap[]): boolean[] {
  const doubleTap = new DoubleTap();
  return taps.map(([ms, x, { rest = 60, slide = 0, alone = true, taken = false } = {}]) => {
    doubleTap.down({ x, y: 0 }, ms, alone);
    if (taken) doubleTap.cancel();
    return doubleTap.up({ x: x + slide, y: 0 }, ms + rest);
  });
}

const CASES: readonly [string, Tap[], boolean[]][] = [
  [
    'two at one place',
    [
      [0, 0],
      [200, 20],
    ],
    [false, true],
  ],
  [
    'a third is the first of the next two',
    [
      [0, 0],
      [200, 0],
      [400, 0],
      [600, 0],
    ],
    [false, true, false, true],
  ],
  [
    'too late',
    [
      [0, 0],
      [400, 0],
      [600, 0],
    ],
    [false, false, true],
  ],
  [
    'too far apart',
    [
      [0, 0],
      [200, 40],
      [400, 40],
    ],
    [false, false, true],
  ],
  [
    'held',
    [
      [0, 0, { rest: 400 }],
      [500, 0],
    ],
    [false, false],
  ],
  [
    'dragged',
    [
      [0, 0],
      [200, 0, { slide: 11 }],
      [400, 0],
    ],
    [false, false, false],
  ],
  [
    'with a second finger',
    [
      [0, 0],
      [200, 0, { alone: false }],
      [400, 0],
    ],
    [false, false, false],
  ],
  [
    "the page's scrolling",
    [
      [0, 0],
      [200, 0, { taken: true }],
      [400, 0],
    ],
    [false, false, false],
  ],
];

for (const [name, taps, expected] of CASES) {
  test(`double taps: ${name}`, () => assert.deepEqual(doubles(taps), expected));
}
