/** Prediction of cameras, the rate of uploads, and their benefit for a flight over a streamed scene: simulated, without a GPU. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { eyeOf, lookAt, type Camera, type Vector3 } from '@gaussian-splat/core';
import {
  CameraMotion,
  folderSource,
  MAX_UPLOAD_BYTES,
  UPLOAD_SHARE,
  UploadBudget,
} from '@gaussian-splat/renderer/stages';
import { detailFolder } from '../support/detail-folder.js';
import { FlightPages } from '../support/flight-pages.js';
import { fly } from '../support/flight.js';
import { pebbles } from '../support/scenes/pebbles.js';

const lens = { width: 96, height: 64, fx: 80, fy: 80, cx: 48, cy: 32, near: 0.01, far: 100 };

/** At a place, looking along a direction in the plane. */
const cameraAt = (eye: Vector3, radians: number): Camera => {
  const target: Vector3 = [eye[0] + Math.cos(radians), eye[1], eye[2] + Math.sin(radians)];
  return { ...lens, worldToCamera: lookAt(eye, target, [0, -1, 0]) };
};

/** Notes cameras 60 times a second. @param of gets milliseconds */
function watched(milliseconds: number, of: (time: number) => Camera): CameraMotion {
  const motion = new CameraMotion();
  const frames = Math.round((milliseconds * 60) / 1000);
  for (let frame = 0; frame <= frames; frame++) motion.observe(of((1000 * frame) / 60), (1000 * frame) / 60);
  return motion;
}

/** Largest difference of two cameras' matrices. */
const apart = (a: Camera, b: Camera): number =>
  Math.max(...Array.from(a.worldToCamera, (x, k) => Math.abs(x - b.worldToCamera[k])));

test('a camera that moves and turns evenly is foreseen exactly, half a second and a radian at most', () => {
  const at = (time: number): Camera => cameraAt([0.003 * time, -1, 0.001 * time], 0.002 * time);
  const motion = watched(500, at);
  assert.ok(motion.isMoving);
  for (const ahead of [0, 100, 300, 500]) assert.ok(apart(motion.ahead(ahead), at(500 + ahead)) < 1e-9, `${ahead} ms`);
  const fast = watched(500, (time) => cameraAt([0, 0, 0], 0.01 * time));
  assert.ok(apart(fast.ahead(400), cameraAt([0, 0, 0], 6)) < 1e-9, 'a radian further, not four');
  // Ten frames a second will do.
  const slow = new CameraMotion();
  for (let time = 0; time <= 500; time += 100) slow.observe(at(time), time);
  assert.ok(apart(slow.ahead(200), at(700)) < 1e-9);
});

test('a camera whose matrix is overwritten for every frame is predicted like one with new matrices', () => {
  const worldToCamera = new Float64Array(16);
  const motion = watched(500, (time) => {
    worldToCamera.set(cameraAt([1, 2, 3], 0.002 * time).worldToCamera);
    return { ...lens, worldToCamera };
  });
  assert.ok(motion.isMoving);
  assert.ok(apart(motion.ahead(200), cameraAt([1, 2, 3], 1.4)) < 1e-9);
});

test('nothing is foreseen of a camera that rests, jumps, goes to and fro or was not seen for a while', () => {
  const from: Vector3 = [1, 2, 3];
  const cases: [string, (time: number) => Camera][] = [
    ['rests', () => cameraAt(from, 1)],
    ['jumped', (time) => (time < 480 ? cameraAt(from, 1) : cameraAt([50, 0, 0], 2))],
    ['to and fro', (time) => cameraAt([Math.floor(time / 52) % 2, 0, 0], 0)],
    ['two views in turn', (time) => (Math.round((time * 60) / 1000) % 2 ? cameraAt(from, 1) : cameraAt([9, 9, 9], 3))],
  ];
  for (const [name, of] of cases) {
    const motion = watched(500, of);
    assert.ok(apart(motion.ahead(0), motion.ahead(300)) < 1e-9 && !motion.isMoving, name);
  }
  const motion = watched(500, (time) => cameraAt([0.01 * time, 0, 0], 0));
  motion.observe(cameraAt([8, 0, 0], 0), 2000);
  assert.ok(!motion.isMoving, 'after a rest');
});

test('a camera that comes from rest is foreseen with at most twice the speed that it had', () => {
  const motion = watched(500, (time) => cameraAt([Math.max(0, time - 420) ** 2 / 1000, 0, 0], 0));
  const [now, then] = [motion.ahead(0), motion.ahead(100)].map(({ worldToCamera }) => eyeOf(worldToCamera)[0]);
  // It has 0.16 units a millisecond, and had less than 0.06 a twentieth of a second ago.
  assert.ok(then > now && then - now < 16, `${then - now} units in 100 ms`);
});

test('a matrix that is no rotation is moved, not turned', () => {
  const at = (time: number): Camera => {
    const camera = cameraAt([0.01 * time, 0, 0], 0.001 * time);
    return { ...camera, worldToCamera: Array.from(camera.worldToCamera, (x, k) => (k < 12 ? 2 * x : x)) };
  };
  const [now, then] = [at(500), watched(500, at).ahead(100)];
  assert.ok(Math.abs(eyeOf(then.worldToCamera)[0] - 6) < 1e-6);
  for (const k of [0, 1, 2, 4, 5, 6, 8, 9, 10]) {
    assert.ok(Math.abs(then.worldToCamera[k] - now.worldToCamera[k]) < 1e-9);
  }
});

test('a file that comes short is refused and fetched again, and a view of bytes is as good as their buffer', async () => {
  const { manifest, files } = detailFolder(pebbles(2_000));
  const { signal } = new AbortController();
  const answers: (ArrayBuffer | Uint8Array<ArrayBuffer>)[] = [];
  let fetched = 0;
  const source = folderSource(manifest, () => {
    fetched++;
    return Promise.resolve(answers.shift()!);
  });
  const whole = files.get('pages/scene-00000.bin')!;
  const padded = new Uint8Array(whole.byteLength + 24);
  padded.set(new Uint8Array(whole), 8);
  const nowhere = new Uint8Array(whole.byteLength).fill(255);
  answers.push(nowhere);
  await assert.rejects(source.fetch(0, signal), { code: 'decode/corrupt' }, 'bounds that are not finite');
  assert.ok(!source.isCached!(0));
  fetched = 0;
  answers.push(whole.slice(8), padded.subarray(8, 8 + whole.byteLength));
  await assert.rejects(source.fetch(0, signal), { code: 'decode/truncated' });
  assert.ok(!source.isCached!(0));
  const [{ words }] = await source.fetch(0, signal);
  assert.deepEqual(words, new Uint32Array(whole));
  await source.fetch(0, signal);
  assert.equal(fetched, 2, 'kept');
});

/** Frames of a page that uploads all it may. @returns bytes of each, and the fraction after it */
function paced(
  frames: number,
  intervalOf: (frame: number, bytes: number) => number,
  msPerMegabyte: number,
): { bytes: number; share: number }[] {
  const quality = new UploadBudget();
  let [now, last] = [0, 0];
  return Array.from({ length: frames }, (_, frame) => {
    now += intervalOf(frame, last);
    last = quality.startFrame(now);
    quality.note(last, (last / 1e6) * msPerMegabyte);
    return { bytes: last, share: quality.share };
  });
}

const close = (found: number, expected: number, tolerance = 0.02): void =>
  assert.ok(Math.abs(found / expected - 1) < tolerance, `${found}, expected ${expected}`);

test('a frame uploads what an eighth of its time is enough for at first, and a little more with each that comes in time, up to a quarter, 5 ms and 14 MB', () => {
  const interval = 1000 / 60;
  const frames = paced(200, () => interval, 1);
  close(frames[20].bytes, frames[20].share * interval * 1e6, 0.1);
  close(frames[11].share - frames[10].share, 1 / 512);
  assert.ok(frames[1].share < 0.13 && frames[20].share < 0.17);
  assert.equal(frames.at(-1)!.share, UPLOAD_SHARE.max);
  close(frames.at(-1)!.bytes, (interval / 4) * 1e6);
  assert.equal(paced(60, () => interval, 0.01).at(-1)!.bytes, MAX_UPLOAD_BYTES);
  // However slow the frames are: what makes them slow may be the uploads. And a millisecond, however quick they are.
  close(paced(60, () => 500, 4).at(-1)!.bytes, 1.25e6);
  close(paced(60, () => 1, 4).at(-1)!.bytes, 0.25e6);
});

test('a late frame halves the fraction, one after a rest does not, and one that uploads little does not raise it', () => {
  const interval = 1000 / 60;
  const late = paced(61, (frame) => (frame === 60 ? 2 : 1) * interval, 1);
  close(late[60].share, Math.max(UPLOAD_SHARE.min, late[59].share / 2));
  const rested = paced(61, (frame) => (frame === 60 ? 1000 : interval), 1);
  assert.equal(rested[60].share, rested[59].share);
  const lazy = new UploadBudget();
  for (let frame = 0; frame < 100; frame++) {
    lazy.startFrame(interval * frame);
    lazy.note(65_536, 0.1);
  }
  assert.equal(lazy.share, UPLOAD_SHARE.min);
});

test('where uploads above 4 MB make a display leave a frame out, few are, and most of what would do is uploaded', () => {
  const interval = 1000 / 60;
  const frames = paced(1200, (_, bytes) => (bytes > 4e6 ? 2 : 1) * interval, 1).slice(300);
  const lates = frames.filter(({ bytes }) => bytes > 4e6).length;
  const mean = frames.reduce((sum, { bytes }) => sum + bytes, 0) / frames.length;
  assert.ok(lates < 0.05 * frames.length, `${lates} of ${frames.length} late`);
  assert.ok(mean > 2.5e6 && mean < 4e6, `${mean} bytes a frame`);
});

test('a clock that ticks once a millisecond gives the same share on average', () => {
  const interval = 1000 / 60;
  const quality = new UploadBudget();
  let [now, uploaded, allowed] = [0, 0, 0];
  for (let frame = 0; frame < 600; frame++) {
    const bytes = quality.startFrame(interval * frame);
    if (frame >= 100) {
      uploaded += bytes;
      allowed += (quality.share * interval * 1e6) / 1.3;
    }
    const took = (bytes / 1e6) * 1.3;
    quality.note(bytes, Math.floor(now + took) - Math.floor(now));
    now += took + 7.77;
  }
  close(uploaded, Math.min(allowed, (500 * 5e6) / 1.3), 0.2);
});

test('in a flight, the view has a smaller error if pages are requested ahead of the camera', async () => {
  const places = Array.from({ length: 144 }, (_, k) => [14 * (k % 12), 0, 14 * Math.floor(k / 12)] as const);
  const { manifest, files } = detailFolder(pebbles(4_000), places);
  const pages = new FlightPages(manifest, (file) => files.get(file)!);
  const options = {
    ...{ bounds: manifest.bounds, width: 480, height: 270, slots: 700, bytes: 65_536, warm: 1, seconds: 10 },
    ...{ latencyMs: 30, bandwidth: 4e7, uploadMs: 0.5, kept: 1e6, isWithoutCopies: true },
  };
  const [still, ahead] = [await fly(pages, { ...options, isStill: true }), await fly(pages, options)];
  const mean = (rows: typeof still, of: (row: (typeof still)[0]) => number): number =>
    rows.reduce((sum, row) => sum + of(row), 0) / rows.length;
  const [without, foreseen] = [still, ahead].map((rows) => [
    mean(rows, (row) => row.error),
    mean(rows, (row) => row.mean),
  ]);
  const text = ([ends, frames]: readonly number[]): string =>
    `${ends.toFixed(2)} at the ends of seconds, ${frames.toFixed(2)} in all frames`;
  console.log(`${pages.list.count} pages; pixels: ${text(without)}; ahead of the camera ${text(foreseen)}`);
  assert.ok(without[0] > 0.3, 'the flight is faster than its pages');
  assert.ok(foreseen[0] < 0.7 * without[0] && foreseen[1] < 0.7 * without[1]);
});
