import assert from 'node:assert/strict';
import { test } from 'node:test';
import { FrameRoom } from '../support/element/parts.js';

const MB = 1 << 20;

test('two seconds of frames, fewer of short sequences', () => {
  assert.equal(new FrameRoom(300, 24).frames, 48);
  assert.equal(new FrameRoom(7, 24).frames, 7);
  assert.equal(new FrameRoom(300, 0.1).frames, 2);
});

test('no more than 256 MB, by the largest frame until then, but always two', () => {
  const room = new FrameRoom(300, 24);
  room.note(MB / 2);
  assert.equal(room.frames, 48);
  room.note(16 * MB);
  assert.equal(room.frames, 16);
  room.note(MB);
  assert.equal(room.frames, 16);
  room.note(400 * MB);
  assert.equal(room.frames, 2);
});
