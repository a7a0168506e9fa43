/** Splats are followed through frames that do not say which of them were in the one before. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { followSplats } from '../../packages/economise/src/clip/tracks.js';
import { fountain } from '../support/scenes/fountain.js';

test('drops that are born fast and close together keep their own track', () => {
  const frameOf = fountain({ splats: 40_000, frames: 300, framesPerSecond: 30 });
  const frames = Array.from({ length: 6 }, (_, frame) => frameOf(45 + frame));
  const tracks = followSplats(frames);
  const sizeOf = new Map<number, number>();
  let changes = 0;
  frames.forEach(({ scales }, f) => {
    tracks.of[f].forEach((track, i) => {
      // The volume of a splat of this scene never changes, and no two have the same.
      const volume = scales[3 * i] * scales[3 * i + 1] * scales[3 * i + 2];
      const before = sizeOf.get(track);
      if (before !== undefined && Math.abs(volume / before - 1) > 1e-3) changes++;
      sizeOf.set(track, volume);
    });
  });
  assert.ok(changes < 20, `${changes} times a track goes over to another splat`);
});
