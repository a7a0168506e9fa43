/** Splats are followed through frames that do not say which of them were in the one before. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { cutTracks } from '../../packages/economise/src/clip/cut-tracks.js';
import { followSplats } from '../../packages/economise/src/clip/tracks.js';
import { clipFrame, LoadBudget, parseClip, readClipPart, upright } from '@gaussian-splat/formats';
import { clipOf } from '../support/clips.js';
import { cloudOf } from '../support/clouds.js';
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

test('a track that goes over to another splat is divided, one that turns is not', () => {
  const spin = (angle: number): readonly [number, number, number, number] => [
    Math.cos(angle / 2),
    0,
    0,
    Math.sin(angle / 2),
  ];
  const scale = [0.1, 0.05, 0.02] as const;
  const frames = Array.from({ length: 6 }, (_, frame) =>
    cloudOf([
      // In its place, from the fourth frame on, is another one.
      {
        position: [0, 0, 0],
        color: [0.5, 0.5, 0.5],
        opacity: 0.9,
        rotation: spin(frame < 3 ? 0 : 0.5),
        scale: [...scale],
      },
      { position: [3, 0, 0], color: [0.5, 0.5, 0.5], opacity: 0.9, rotation: spin(0.3 * frame), scale: [...scale] },
    ]),
  );
  const followed = followSplats(frames);
  assert.equal(followed.count, 2);
  const { count, of, lives } = cutTracks(followed);
  assert.equal(count, 3);
  assert.deepEqual([...lives.first], [0, 0, 3]);
  assert.deepEqual([...lives.end], [3, 6, 6]);
  assert.deepEqual(
    of.map((tracks) => [...tracks]),
    [0, 1, 2, 3, 4, 5].map((frame) => [frame < 3 ? 0 : 2, 1]),
  );
});

test('frames that name another direction up become a clip that stands upright, scene and motion alike', async () => {
  const frames = Array.from({ length: 4 }, (_, frame) =>
    Array.from({ length: 30 }, (_, i) => ({
      position: [i % 5, 0.1 * frame + i / 30, Math.floor(i / 5) + 0.2 * frame] as const,
      ...{ color: [0.5, 0.5, 0.5] as const, opacity: 0.9, scale: 0.1 },
    })),
  ).map((splats) => ({ ...cloudOf(splats), hints: { up: [0, 0, 1] as const } }));
  const { bytes } = await clipOf((frame) => frames[frame], { frames: 4, framesPerGroup: 4, name: 'a.spz' });
  const index = parseClip(bytes, 'a.gsv');
  const contents = await Promise.all(
    index.groups[0].parts.map((part) => {
      const own = bytes.subarray(part.start, part.start + part.sceneBytes + part.motionBytes);
      return readClipPart({ bytes: own, part, frames: 4, name: 'a.gsv' });
    }),
  );
  for (const frame of [0, 3]) {
    const shown = clipFrame(contents, frame, 'a.gsv', new LoadBudget(bytes.length));
    const source = upright(frames[frame]);
    const distances = Array.from({ length: 30 }, (_, i) =>
      Math.min(
        ...Array.from({ length: 30 }, (_, k) =>
          Math.hypot(...[0, 1, 2].map((axis) => shown.positions[3 * k + axis] - source.positions[3 * i + axis])),
        ),
      ),
    );
    assert.ok(Math.max(...distances) < 0.02, `frame ${frame}: ${Math.max(...distances)}`);
  }
  assert.equal(index.bounds.up, undefined);
});
