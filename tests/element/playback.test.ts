/** The clock of scenes that move, against what HTML has for video. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { PlaybackController, type PlaybackEvent } from '../support/element/parts.js';

/** A clock of a scene of four seconds, with the frames that it asked for, its events, and listeners of these. */
function clock(
  loop = false,
  listeners: Partial<Record<PlaybackEvent, () => void>> = {},
): { playback: PlaybackController; events: PlaybackEvent[]; frames: () => number } {
  const events: PlaybackEvent[] = [];
  let frames = 0;
  const playback = new PlaybackController({
    attributes: { loop, time: null },
    requestFrame: () => frames++,
    playbackEvent: (type) => {
      events.push(type);
      listeners[type]?.();
    },
  });
  playback.setDuration(4);
  return { playback, events, frames: () => frames };
}

test('play() starts from the beginning if the time was set to the end', () => {
  const { playback } = clock();
  playback.currentTime = 4;
  playback.play();
  assert.equal(playback.currentTime, 0);
  for (const now of [0, 1000]) playback.tick(now);
  assert.deepEqual([playback.currentTime, playback.paused], [1, false]);
});

test('in reverse, play() begins at the end', () => {
  const { playback, events } = clock();
  playback.playbackRate = -1;
  playback.play();
  assert.equal(playback.currentTime, 4);
  for (const now of [0, 1000, 5000]) playback.tick(now);
  assert.deepEqual([playback.currentTime, playback.paused, events.at(-1)], [0, true, 'ended']);
  playback.play();
  assert.equal(playback.currentTime, 4);
});

test('a rate of 0 stands: no frame is requested, and no time has passed when it continues', () => {
  const { playback, frames } = clock();
  playback.play();
  for (const now of [0, 1000]) playback.tick(now);
  playback.playbackRate = 0;
  const before = frames();
  playback.tick(2000);
  assert.deepEqual([playback.currentTime, playback.paused, frames() - before], [1, false, 0]);
  playback.playbackRate = 2;
  for (const now of [9000, 9500]) playback.tick(now);
  assert.equal(playback.currentTime, 2);
});

test('a frame that comes late does not pass over times that are not loaded: the clock stops at them, and says so', () => {
  const { playback, events } = clock();
  playback.play();
  playback.tick(0, 1.5);
  playback.tick(9000, 1.5);
  assert.deepEqual([playback.currentTime, playback.ended], [1.5, false]);
  playback.tick(9016, 1.5);
  assert.equal(events.filter((type) => type === 'waiting').length, 1);
  playback.tick(9500);
  playback.tick(10_000);
  assert.deepEqual([playback.currentTime, events.slice(-5, -2)], [2, ['canplay', 'canplaythrough', 'playing']]);
});

test('a clock that starts again before a time that is not loaded says that it waits', () => {
  const { playback, events } = clock();
  playback.play();
  playback.tick(0, 1.5);
  playback.tick(1500, 1.5);
  playback.suspend();
  playback.tick(1516, 1.5);
  playback.tick(1532, 1.5);
  assert.equal(events.filter((type) => type === 'waiting').length, 1);
});

test('a listener of seeked that seeks decides the time, and one that pauses stops the clock there', () => {
  const listeners: Parameters<typeof clock>[1] = {};
  const { playback, events } = clock(false, listeners);
  playback.play();
  playback.tick(0);
  playback.currentTime = 1;
  listeners.seeked = () => {
    listeners.seeked = undefined;
    playback.currentTime = 3;
  };
  playback.tick(100);
  assert.deepEqual([playback.currentTime, playback.seeking], [3, true]);
  playback.tick(200);
  assert.ok(playback.currentTime > 3 && !playback.seeking, `${playback.currentTime} s`);
  playback.currentTime = 3.95;
  listeners.seeked = () => playback.pause();
  playback.tick(300);
  assert.deepEqual([playback.currentTime, playback.paused], [3.95, true]);
  assert.deepEqual(events.slice(-2), ['timeupdate', 'pause'], 'neither a second pause nor an end');
});

test('a pause ends the wait: the next play() waits again, and another scene does not continue from it', () => {
  const { playback, events } = clock();
  const count = (type: PlaybackEvent): number => events.filter((each) => each === type).length;
  playback.play();
  for (const now of [0, 1500, 1516]) playback.tick(now, 1.5);
  playback.pause();
  playback.play();
  playback.tick(1532, 1.5);
  assert.equal(count('waiting'), 2);
  playback.empty();
  playback.setDuration(4);
  playback.play();
  playback.tick(1600);
  assert.equal(count('canplay'), 0);
});

test('loadedmetadata is for scenes that move', () => {
  const { playback, events } = clock();
  playback.setDuration(NaN);
  assert.deepEqual(events, ['durationchange', 'loadedmetadata', 'durationchange']);
});
