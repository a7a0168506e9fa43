/** Splats are followed through frames that do not say which of them were in the one before. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { FINER, minCurve } from '../../packages/optimize/src/clip/curves.js';
import { cutTracks } from '../../packages/optimize/src/clip/cut-tracks.js';
import { followedWithin } from '../../packages/optimize/src/clip/partial-curves.js';
import { roundMotion } from '../../packages/optimize/src/clip/round-motion.js';
import { followSplats } from '../../packages/optimize/src/clip/tracks.js';
import { parseClip, readClipPart, upright } from '@gaussian-splat/formats';
import { onlyInLab } from '../support/extent.js';
import { clipOf, framesOf } from '../support/clips.js';
import { cloudOf } from '../support/clouds.js';
import { seededRandom } from '../support/random.js';
import { fountain } from '../support/scenes/fountain.js';
import { MADE_CLIPS } from '../support/scenes/made-clips.js';

test('drops that are born fast and close together keep their own track', { skip: onlyInLab }, () => {
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

test('splats of a dense body that turns are followed, though each passes many others between two frames', async () => {
  const spin = await MADE_CLIPS.spin({ splats: 20_000, frames: 3 });
  assert.equal(cutTracks(followSplats([0, 1, 2].map(spin))).count, 20_000);
});

test('limbs that move farther than splats are apart are followed by the order of the frames', () => {
  const random = seededRandom(5);
  const splats = Array.from({ length: 20_000 }, () => ({
    position: [random.uniform(0, 4), random.uniform(0, 0.02), random.uniform(0, 4)] as [number, number, number],
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
    ...{ opacity: 0.9, scale: random.uniform(0.01, 0.1) },
  }));
  const frames = [0, 0.2, 0.4].map((step) =>
    cloudOf(
      splats.map((splat, i) => {
        const [x, y, z] = splat.position;
        return { ...splat, position: [i % 20 === 0 ? x + step : x, y, z] as const };
      }),
    ),
  );
  assert.equal(cutTracks(followSplats(frames)).count, 20_000);
});

test('splats behind one that has disappeared keep their tracks, though their indices are those of others', () => {
  const random = seededRandom(6);
  const [bodies, drops] = [3000, 600];
  const all = Array.from({ length: bodies + drops + 30 }, (_, i) => {
    const extent = i < bodies ? 4 : 0.2;
    return {
      position: [random.uniform(0, extent), random.uniform(0, extent), random.uniform(0, extent)] as const,
      color: [0.5, 0.65, i < bodies ? random.uniform(0, 0.5) : 0.9] as const,
      scale: [0.02 * random.uniform(0.6, 1.3), 0.02 * random.uniform(0.4, 1), 0.005] as const,
      ...{ opacity: 0.9, rotation: random.rotation() },
    };
  });
  // In each frame, ten drops at the beginning are gone, and ten are new at the end.
  const frames = [0, 1, 2, 3].map((frame) =>
    cloudOf(all.filter((_, i) => i < bodies || (i >= bodies + 10 * frame && i < bodies + drops + 10 * frame))),
  );
  const { of } = followSplats(frames);
  const sizes = new Map<number, number>();
  let changes = 0;
  frames.forEach(({ scales }, f) =>
    of[f].forEach((track, i) => {
      if (sizes.has(track) && sizes.get(track) !== scales[3 * i]) changes++;
      sizes.set(track, scales[3 * i]);
    }),
  );
  assert.ok(changes < 150, `${changes} times a track goes over to another splat`);
});

test('a splat that jumps in its short life does not make the motion of all others coarser', () => {
  const [rows, frames, step] = [300, 50, 0.0003];
  const random = seededRandom(3);
  const changes = new Float32Array(rows * frames);
  const lives = Array.from({ length: rows }, (_, row) => {
    const first = Math.floor(random.uniform(0, 40));
    const end = Math.min(frames, first + (row === 0 ? 4 : Math.floor(random.uniform(10, 45))));
    const speed = random.uniform(-1, 1);
    for (let f = first; f < end; f++) {
      const jump = row === 0 && f >= first + 2 ? 0.5 * (f % 2 ? 1 : -1) : 0;
      changes[frames * row + f] = (speed * (f - first)) / 30 + jump + 1e-4 * random.normal();
    }
    return [first, end] as const;
  });
  const found = followedWithin(changes, frames, (row) => lives[row], minCurve(step / FINER));
  const { part } = roundMotion(found, step, new Float32Array(rows).fill(1));
  assert.equal(part.step, Math.fround(step));
});

test('a change that all splats have in common is exact with any step, also for splats of little effect', () => {
  const [rows, frames] = [300, 12];
  const at = (f: number): number => 0.2 * Math.sin(0.5 * f);
  const changes = Float32Array.from({ length: rows * frames }, (_, k) => at(k % frames));
  const found = followedWithin(changes, frames, () => [0, frames], minCurve(0.01));
  const importance = Float32Array.from({ length: rows }, (_, i) => (i % 3 ? 1.4 : 0.01));
  for (const step of [0.01, 0.11, 0.5, 3]) {
    const { part } = roundMotion(found, step, importance);
    for (let k = 0; k < changes.length; k++) {
      const [row, f] = [Math.floor(k / frames), k % frames];
      let change = 0;
      for (let n = 0; n < part.rank; n++) change += part.step * part.curves[part.rank * f + n] * part.codes[n][row];
      assert.ok(Math.abs(change - at(f)) < 2e-3, `step ${step}, splat ${row}, frame ${f}: ${change}, not ${at(f)}`);
    }
  }
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
      ...[6, 9, 12].map((x) => ({
        position: [x, 0, 0] as const,
        color: [0.5, 0.5, 0.5] as const,
        opacity: 0.9,
        scale: [...scale] as const,
      })),
    ]),
  );
  const followed = followSplats(frames);
  assert.equal(followed.count, 5);
  const { count, of, lives } = cutTracks(followed);
  assert.equal(count, 6);
  assert.deepEqual([...lives.first], [0, 0, 0, 0, 0, 3]);
  assert.deepEqual([...lives.end], [3, 6, 6, 6, 6, 6]);
  assert.deepEqual(
    of.map((tracks) => [...tracks]),
    [0, 1, 2, 3, 4, 5].map((frame) => [frame < 3 ? 0 : 5, 1, 2, 3, 4]),
  );
});

test('splats of frames that were trained one by one keep their tracks, though rotations and colors are noisy', () => {
  const random = seededRandom(8);
  const splats = Array.from({ length: 2000 }, () => ({
    position: [random.uniform(0, 4), random.uniform(0, 4), random.uniform(0, 4)] as const,
    color: [random.uniform(0.2, 0.8), random.uniform(0.2, 0.8), 0.5] as const,
    ...{ rotation: random.rotation(), opacity: 0.9, scale: [0.1, 0.06, 0.02] as const },
  }));
  const noisy = (values: readonly number[], size: number): number[] =>
    values.map((value) => value + size * random.normal());
  const frames = Array.from({ length: 12 }, () =>
    cloudOf(
      splats.map((splat) => ({
        ...splat,
        color: noisy(splat.color, 0.015) as unknown as readonly [number, number, number],
        rotation: noisy(splat.rotation, 0.03) as unknown as readonly [number, number, number, number],
      })),
    ),
  );
  const { count } = cutTracks(followSplats(frames));
  assert.ok(count < 2020, `${count} tracks of 2,000 splats`);
});

test('rows that are absent from a frame are followed in all others, however many curves that needs', () => {
  const [rows, frames] = [60, 40];
  const random = seededRandom(4);
  const changes = Float32Array.from({ length: rows * frames }, () => random.normal());
  const source = changes.slice();
  const spanOf = (row: number): readonly [number, number] => (row < 20 ? [row % 3, frames - 1] : [0, frames]);
  const { curves, shares } = followedWithin(changes, frames, spanOf, minCurve(0.01 / FINER));
  let worst = 0;
  for (let row = 0; row < rows; row++) {
    const [first, end] = spanOf(row);
    for (let f = first; f < end; f++) {
      const found = curves.reduce((sum, curve, k) => sum + curve[f] * shares[k][row], 0);
      worst = Math.max(worst, Math.abs(found - source[frames * row + f]));
    }
  }
  assert.ok(worst < 1e-3, `${worst} in a valid frame`);
});

const shownAt = (bytes: Uint8Array, frame: number): Promise<GaussianCloud> => framesOf(bytes)(frame);

/** Asserts that each splat of a cloud is visible in another one, at its place with its opacity and coefficients. */
function assertShown(shown: GaussianCloud, source: GaussianCloud, what: string): void {
  const [from, to] = [source, shown].map(({ shDegree }) => 3 * shCoefficientCount(shDegree));
  let visible = 0;
  for (let k = 0; k < shown.count; k++) if (shown.opacities[k] > 0.01) visible++;
  assert.equal(visible, source.count, `${what}: splats`);
  for (let i = 0; i < source.count; i++) {
    const distances = Array.from({ length: shown.count }, (_, k) =>
      Math.hypot(
        shown.opacities[k] - source.opacities[i],
        ...[0, 1, 2].map((axis) => shown.positions[3 * k + axis] - source.positions[3 * i + axis]),
        ...Array.from({ length: to }, (_, c) => shown.sh[to * k + c] - (c < from ? source.sh[from * i + c] : 0)),
      ),
    );
    assert.ok(Math.min(...distances) < 0.05, `${what}: splat ${i} is ${Math.min(...distances)} away`);
  }
}

const SPLATS = 12;
/** A frame of a row of splats that moves. The last splat is only in odd frames. */
const rowAt = (frame: number, shDegree: ShDegree = 0): GaussianCloud =>
  cloudOf(
    Array.from({ length: SPLATS - 1 + (frame % 2) }, (_, i) => ({
      position: [i, 0.1 * frame, i === SPLATS - 1 ? 3 : 0] as const,
      ...{ color: [0.2 + 0.05 * i, 0.5, 0.5] as const, opacity: 0.8, scale: 0.1 + 0.01 * i },
      sh: Array.from({ length: 45 }, (_, k) => 0.02 * ((i + k) % 5)),
    })),
    shDegree,
  );

test('one frame, two and three, and frames that are equal, become clips with these frames', async () => {
  for (const frames of [1, 2, 3]) {
    for (const [name, frameOf] of [
      ['others', (frame: number) => rowAt(frame)],
      ['equal', () => rowAt(1)],
    ] as const) {
      const { bytes } = await clipOf(frameOf, { frames, framesPerGroup: 2 });
      assert.equal(parseClip(bytes, 'a.gsv').frameCount, frames);
      for (let frame = 0; frame < frames; frame++)
        assertShown(await shownAt(bytes, frame), frameOf(frame), `${frames} frames, ${name}, frame ${frame}`);
    }
  }
});

test('frames of different degrees become a clip of the highest, in which no group has less than its frames', async () => {
  const degrees = [0, 2, 1, 3] as const;
  const frameOf = (frame: number): GaussianCloud => rowAt(1, degrees[frame]);
  for (const framesPerGroup of [1, 2, 4]) {
    const { bytes } = await clipOf(frameOf, { frames: 4, framesPerGroup });
    const index = parseClip(bytes, 'a.gsv');
    assert.equal(index.shDegree, 3);
    for (let frame = 0; frame < 4; frame += framesPerGroup) {
      // Coefficients above the constant one are those of the frame in which a splat is most opaque, here the first.
      const shown = await shownAt(bytes, frame);
      assert.equal(shown.shDegree, 3);
      assertShown(shown, frameOf(frame), `groups of ${framesPerGroup}, frame ${frame}`);
    }
    const { frames, parts } = index.groups.at(-1)!;
    const { start, sceneBytes, motionBytes } = parts[0];
    const part = { bytes: bytes.subarray(start, start + sceneBytes + motionBytes), part: parts[0], frames };
    await assert.rejects(readClipPart({ ...part, shDegree: 2, name: 'a.gsv' }), /degree 2 at most.*degree 3/s);
  }
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
  for (const frame of [0, 3]) {
    const shown = await shownAt(bytes, frame);
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
