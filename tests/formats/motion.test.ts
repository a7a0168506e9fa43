/** Files of motion: frames come back as near as their steps say, and all other contents of a file end in a named error. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { constants, deflateRawSync, inflateRawSync } from 'node:zlib';
import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { alignAxes, writeMotion, type MotionSteps } from '@gaussian-splat/economise';
import { LoadBudget, applyMotion, readMotion, type Motion } from '@gaussian-splat/formats';
import { randomSource } from '../support/gpu.js';
import { pebbles } from '../support/scenes/pebbles.js';

const STEPS: MotionSteps = { position: 0.002, rotation: 0.004, scale: 0.004, opacity: 0.004, color: 0.004 };
const deflate = (bytes: Uint8Array): Uint8Array => deflateRawSync(bytes, { finishFlush: constants.Z_SYNC_FLUSH });
const FRAMES = 12;
const name = 'motion.bin';

/** Splats that turn about the middle, pulse, fade and change color, by another curve each. */
function frameOf(first: GaussianCloud, frame: number): GaussianCloud {
  const share = (frame + 1) / FRAMES;
  const angle = 2.5 * share;
  const [c, s] = [Math.cos(angle / 2), Math.sin(angle / 2)];
  const cloud = {
    ...first,
    ...{ positions: first.positions.slice(), scales: first.scales.slice(), rotations: first.rotations.slice() },
    ...{ opacities: first.opacities.slice(), sh: first.sh.slice() },
  };
  const stride = first.sh.length / first.count;
  for (let i = 0; i < first.count; i++) {
    const [x, , z] = first.positions.subarray(3 * i, 3 * i + 3);
    cloud.positions[3 * i] = Math.cos(angle) * x + Math.sin(angle) * z;
    cloud.positions[3 * i + 2] = Math.cos(angle) * z - Math.sin(angle) * x;
    const [w, a, b, d] = first.rotations.subarray(4 * i, 4 * i + 4);
    cloud.rotations.set([c * w - s * b, c * a + s * d, c * b + s * w, c * d - s * a], 4 * i);
    cloud.scales[3 * i] *= 1 + 0.3 * Math.sin(6 * share + i);
    cloud.opacities[i] *= 1 - 0.4 * share * (i % 2);
    cloud.sh[stride * i + 1] += 0.3 * Math.cos(5 * share);
  }
  return cloud;
}

const first = pebbles(700);
const frames = Array.from({ length: FRAMES }, (_, frame) => frameOf(first, frame));
const budget = (): LoadBudget => new LoadBudget(1 << 24);
const written = writeMotion(first, frames, { steps: STEPS, deflate });
const read = (bytes: Uint8Array, asked: object = {}): Promise<Motion> =>
  readMotion({ ...{ bytes, name, splats: first.count, frames: FRAMES, budget: budget() }, ...asked });

/** Covariance of a splat, upper triangle. */
function covariance({ rotations, scales }: GaussianCloud, i: number): number[] {
  const [w, x, y, z] = rotations.subarray(4 * i, 4 * i + 4);
  const rows = [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
  const variance = [0, 1, 2].map((k) => scales[3 * i + k] ** 2);
  return [0, 1, 2].flatMap((a) =>
    [0, 1, 2].map((b) => variance.reduce((sum, value, k) => sum + value * rows[a][k] * rows[b][k], 0)),
  );
}

test('each attribute of each frame is as near as its step', async () => {
  const motion = await read(written);
  for (const [frame, asked] of frames.entries()) {
    const found = applyMotion(first, motion, frame, name, budget());
    const far = (a: Float32Array, b: Float32Array): number =>
      a.reduce((max, value, i) => Math.max(max, Math.abs(value - b[i])), 0);
    assert.ok(far(found.positions, asked.positions) < 6 * STEPS.position, `positions of ${frame}`);
    assert.ok(far(found.opacities, asked.opacities) < 6 * STEPS.opacity, `opacities of ${frame}`);
    assert.ok(far(found.sh, asked.sh) < 6 * STEPS.color, `colors of ${frame}`);
    for (let i = 0; i < first.count; i++) {
      const [own, other] = [covariance(found, i), covariance(asked, i)];
      const size = Math.max(...other);
      own.forEach((value, k) =>
        assert.ok(Math.abs(value - other[k]) < 0.05 * size, `shape of splat ${i}, frame ${frame}`),
      );
    }
  }
  const bytesOfSplat = written.length / first.count / FRAMES;
  assert.ok(bytesOfSplat < 4, `${bytesOfSplat} bytes a splat and frame`);
  assert.equal(first.positions[0], pebbles(700).positions[0], 'the first frame is left as it was');
});

test('what does not move costs nothing, and frames whose axes have other names are the same', async () => {
  const still = writeMotion(first, [first, first], { steps: STEPS, deflate });
  assert.ok(still.length < 100, `${still.length} bytes`);
  const half = Math.SQRT1_2;
  const renamed = { ...first, rotations: first.rotations.slice(), scales: first.scales.slice() };
  for (let i = 0; i < first.count; i++) {
    const [w, x, y, z] = first.rotations.subarray(4 * i, 4 * i + 4);
    renamed.rotations.set([half * (w - z), half * (x + y), half * (y - x), half * (z + w)], 4 * i);
    renamed.scales.set([first.scales[3 * i + 1], first.scales[3 * i]], 3 * i);
  }
  const back = alignAxes(renamed, first);
  const again = writeMotion(first, [back, back], { steps: STEPS, deflate });
  assert.ok(again.length < 1_000, `${again.length} bytes`);
});

test('frames of other splats are refused by name when written, files of others when read', async () => {
  assert.throws(() => writeMotion(first, [pebbles(600)], { steps: STEPS, deflate }), /700 splats in each/);
  const refused = (asked: object, message: RegExp): Promise<void> =>
    assert.rejects(read(written, asked), (error) => error instanceof GaussianSplatError && message.test(error.message));
  await refused({ splats: 701 }, /701 splats/);
  await refused({ frames: 11 }, /11 frames/);
  await refused({ bytes: new TextEncoder().encode('<!doctype html><html>') }, /page|HTML/i);
});

test('announced sizes are charged before allocation, and hostile ones end in named errors', async () => {
  const whole = inflateRawSync(written);
  const changed = (change: (view: DataView) => void): Uint8Array => {
    const copy = new Uint8Array(whole);
    change(new DataView(copy.buffer));
    return deflateRawSync(copy);
  };
  const codeOf = (bytes: Uint8Array, asked?: object): Promise<string> =>
    read(bytes, asked).then(
      () => 'read',
      (error: unknown) => (error instanceof GaussianSplatError ? error.code : String(error)),
    );
  assert.equal(await codeOf(changed((view) => view.setUint32(0, 2, true))), 'decode/unsupported');
  assert.equal(await codeOf(changed((view) => view.setUint32(12, FRAMES + 1, true))), 'decode/header');
  assert.equal(await codeOf(changed((view) => view.setFloat32(16, NaN, true))), 'decode/corrupt');
  assert.equal(await codeOf(changed((view) => view.setFloat32(52, Infinity, true))), 'decode/corrupt');
  assert.equal(await codeOf(deflateRawSync(whole.subarray(0, 40))), 'decode/truncated');
  assert.equal(await codeOf(deflateRawSync(whole.subarray(0, 4000))), 'decode/truncated');
  assert.equal(await codeOf(deflateRawSync(Buffer.concat([whole, whole]))), 'decode/truncated');
  assert.equal(await codeOf(written.subarray(0, 300)), 'decode/corrupt');
  // 1,000,000 splats of 4096 curves each: 106 GB, from a head of 52 bytes.
  const head = new DataView(new ArrayBuffer(52));
  [1, 1e6, 4096, 4096].forEach((value, k) => head.setUint32(4 * k, value, true));
  const bomb = deflateRawSync(Buffer.concat([Buffer.from(head.buffer), Buffer.alloc(1 << 20)]));
  assert.equal(
    await codeOf(bomb, { splats: 1e6, frames: 4096, budget: new LoadBudget(bomb.length) }),
    'out-of-memory/budget',
  );
  const random = randomSource(5);
  for (let k = 0; k < 60; k++) {
    const bytes = changed((view) => {
      for (let n = 0; n < 4; n++) view.setUint8(Math.floor(random() * (n < 2 ? 400 : view.byteLength)), 256 * random());
    });
    const code = await codeOf(bytes);
    assert.match(code, /^(read|decode\/(corrupt|truncated|header|unsupported)|out-of-memory\/budget)$/);
    if (code !== 'read') continue;
    try {
      applyMotion(first, await read(bytes), FRAMES - 1, name, budget());
    } catch (error) {
      assert.ok(error instanceof GaussianSplatError && error.code === 'decode/empty', String(error));
    }
  }
});
