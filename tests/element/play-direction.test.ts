/** The direction of playback, from the frames that are requested. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { indicesFrom, PlayDirection } from '../../packages/element/dist/sources/play-direction.js';

const directionsOf = (frames: readonly number[], loops: boolean): number[] => {
  const direction = new PlayDirection(48, 24);
  return frames.map((frame) => direction.at(frame, loops));
};

test('frames are requested forward or backward, also around the ends of a loop', () => {
  assert.deepEqual(directionsOf([0, 1, 3, 3, 2, 2, 1, 2], false), [1, 1, 1, 1, -1, -1, -1, 1]);
  assert.deepEqual(directionsOf([46, 47, 0, 1], true), [1, 1, 1, 1]);
  assert.deepEqual(directionsOf([2, 1, 0, 47, 46], true), [1, -1, -1, -1, -1]);
});

test('after a seek, the direction is forward', () => {
  assert.deepEqual(directionsOf([30, 29, 5, 6], false), [1, -1, 1, 1]);
  assert.deepEqual(directionsOf([30, 29, 40], false), [1, -1, 1]);
});

test('indices end at the ends of their list, or go around', () => {
  assert.deepEqual(indicesFrom(1, 4, -1, 5, false), [1, 0]);
  assert.deepEqual(indicesFrom(1, 4, -1, 5, true), [1, 0, 4, 3]);
  assert.deepEqual(indicesFrom(3, 4, 1, 5, false), [3, 4]);
  assert.deepEqual(indicesFrom(3, 4, 1, 5, true), [3, 4, 0, 1]);
});
