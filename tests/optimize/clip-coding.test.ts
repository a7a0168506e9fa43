/** Clips keep what the encoder says of them: in every frame, with harmonics that turn, and with still splats once. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import {
  codeClip,
  codeClipRange,
  viewsAround,
  type ClipStore,
  type CodeClipOptions,
  type DrawFrame,
} from '@gaussian-splat/optimize';
import { parseClip, readScene } from '@gaussian-splat/formats';
import { encodeWebp } from '../../packages/cli/src/lib/encoders.mjs';
import { writePartScene } from '../../packages/optimize/src/clip/part-scene.js';
import { sogOf } from '../../packages/optimize/src/write/tune-sog.js';
import { meanSquare } from '../../packages/optimize/src/measure.js';
import { onlyInLab } from '../support/extent.js';
import { clipOf, framesOf } from '../support/clips.js';
import { cloudOf, type SplatDescription } from '../support/clouds.js';
import { seededRandom } from '../support/random.js';
import { turningBall } from '../support/scenes/turning-ball.js';
import { cpuPainter } from './twin/index.js';

const SOG_STEPS = { place: 8, size: 0.1, turn: 6, opacity: 5, color: 0.03, harmonics: 0.02 };
const SPLATS = 200;
const FRAMES = 12;

/** Splats of a ball that drifts in waves. In frames 8 and 9, some of them are white. */
function flashing(frame: number): GaussianCloud {
  const random = seededRandom(9);
  return cloudOf(
    Array.from({ length: SPLATS }, (_, i): SplatDescription => {
      const place = random.direction();
      const own = {
        scale: [random.uniform(0.1, 0.2), random.uniform(0.1, 0.2), random.uniform(0.05, 0.1)] as const,
        ...{ rotation: random.rotation(), opacity: random.uniform(0.5, 0.9) },
        color: [random.uniform(0, 1), random.uniform(0, 1), 0.4] as const,
      };
      const isWhite = i % 10 === 0 && (frame === 8 || frame === 9);
      const position = place.map((value, k) => value + 0.1 * Math.sin(0.3 * frame + 3 * place[(k + 1) % 3]));
      return {
        ...own,
        position: position as unknown as SplatDescription['position'],
        color: isWhite ? [1, 1, 1] : own.color,
      };
    }),
  );
}

/** Draws on the CPU, at a quarter of the size. */
const draw: DrawFrame = async (frame, views) => {
  const small = views.map((view): Camera => ({
    ...view,
    ...{ width: view.width / 4, height: Math.floor(view.height / 4) },
    ...{ fx: view.fx / 4, fy: view.fy / 4, cx: view.cx / 4, cy: view.cy / 4 },
  }));
  const references = await cpuPainter.draw(frame, small);
  return {
    compare: async (cloud) => (await cpuPainter.draw(cloud, small)).map((image, k) => meanSquare(image, references[k])),
    destroy: () => undefined,
  };
};

const options = (frameOf: (frame: number) => GaussianCloud, minPsnr: number): CodeClipOptions => ({
  ...{ frameCount: FRAMES, framesPerSecond: 10, framesPerGroup: 6, minPsnr, draw, encodeWebp },
  openFrame: async (frame) => frameOf(frame),
});

const TARGET = 38;
let coded: ReturnType<typeof codeClip> | undefined;
/** The clip of all frames, coded once. */
const flashingClip = (): ReturnType<typeof codeClip> => (coded ??= codeClip(options(flashing, TARGET)));

test('the PSNR that is returned is that of the worst frame, and all frames were measured', async () => {
  const clip = await flashingClip();
  assert.equal(clip.measured, FRAMES);
  assert.ok(clip.worstPsnr >= TARGET, `${clip.worstPsnr} dB`);
  const frameAt = framesOf(clip.bytes);
  assert.ok(clip.worstViewPsnr <= clip.worstPsnr);
  // Other views than those that were measured.
  const views = viewsAround(parseClip(clip.bytes, 'a.gsv').bounds, 12, { seed: 7777 });
  for (let frame = 0; frame < FRAMES; frame++) {
    const errors = await (await draw(flashing(frame), views)).compare(await frameAt(frame));
    const found = -10 * Math.log10(errors.reduce((sum, error) => sum + error, 0) / errors.length);
    // In few, large splats, two that exchange their order in depth decide the error of a view.
    assert.ok(found > clip.worstPsnr - 2.5, `frame ${frame}: ${found.toFixed(1)} dB`);
  }
});

test('a PSNR that nothing reaches is returned as it is', async () => {
  const blind: DrawFrame = async () => ({ compare: async () => [0.01], destroy: () => undefined });
  const clip = await codeClip({ ...options(flashing, 45), frameCount: 4, draw: blind });
  assert.ok(Math.abs(clip.worstPsnr - 20) < 1e-9);
  assert.equal(clip.measured, 4);
});

/** Files in memory that can be written a number of times. */
class MemoryStore implements ClipStore {
  readonly files = new Map<string, Uint8Array>();
  left = Infinity;

  async read(name: string): Promise<Uint8Array | undefined> {
    return this.files.get(name);
  }

  async write(name: string, bytes: Uint8Array): Promise<void> {
    if (this.left-- <= 0) throw new Error('interrupted');
    this.files.set(name, bytes.slice());
  }
}

test('an interrupted call continues after its last group, and returns the same clip', { skip: onlyInLab }, async () => {
  const given = options(flashing, TARGET);
  const whole = await flashingClip();
  const store = new MemoryStore();
  store.left = 5;
  await assert.rejects(codeClip({ ...given, store }), /interrupted/);
  assert.ok(store.files.has('state.json'));
  store.left = Infinity;
  const steps: string[] = [];
  const progress: number[] = [];
  const again = { store, onStep: (step: string) => steps.push(step), onProgress: (n: number) => progress.push(n) };
  const continued = await codeClip({ ...given, ...again });
  assert.ok(steps.includes('continues with frame 6'), steps.join('\n'));
  assert.deepEqual(progress, [12]);
  assert.deepEqual(continued, whole);
});

test(
  'groups that are coded at the same time, and end in any order, make the same clip; one that fails ends the call',
  { skip: onlyInLab },
  async () => {
    const given = { ...options(room, 34), frameCount: 6, framesPerGroup: 2 };
    const whole = await codeClip(given);
    assert.ok(whole.still > 0 && whole.groups === 3);
    let [running, peak] = [0, 0];
    const jobs: NonNullable<CodeClipOptions['jobs']> = {
      count: 2,
      code: async (range) => {
        peak = Math.max(peak, ++running);
        // The last range is ready first.
        await new Promise((done) => setTimeout(done, 4 * (given.frameCount - range.begin)));
        const state = await codeClipRange(given, structuredClone(range));
        running--;
        return structuredClone(state);
      },
    };
    const store = new MemoryStore();
    assert.deepEqual(await codeClip({ ...given, jobs, store }), whole);
    assert.equal(peak, 2);
    // All groups are in the store.
    assert.deepEqual(await codeClip({ ...given, store }), whole);
    const failing = { ...jobs, code: () => Promise.reject(new Error('no memory')) };
    await assert.rejects(codeClip({ ...given, jobs: failing }), /no memory/);
  },
);

test('a group has more frames by default if few splats move', async () => {
  const still = cloudOf([{ position: [0, 0, 0], scale: 0.1, opacity: 0.9, color: [0.5, 0.5, 0.5] }]);
  const { bytes } = await clipOf(() => still, { frames: 310 });
  assert.deepEqual(
    parseClip(bytes, 'a.gsv').groups.map(({ frames }) => frames),
    [300, 10],
  );
});

/** A room whose twentieth part moves; frames have their splats in other orders, and with noise far below a pixel. */
function room(frame: number): GaussianCloud {
  const random = seededRandom(5);
  const noise = seededRandom(100 + frame);
  const splats = Array.from({ length: 400 }, (_, i): SplatDescription => {
    const position = [random.uniform(-3, 3), random.uniform(-1, 1), random.uniform(-3, 3)] as const;
    const [x, y, z] = position;
    const moved = i % 20 === 0 ? 0.2 * frame : noise.uniform(-1e-4, 1e-4);
    return {
      ...{ position: [x + moved, y, z], scale: random.uniform(0.05, 0.2), opacity: random.uniform(0.4, 0.9) },
      ...{ color: [random.uniform(0, 1), 0.5, 0.5], rotation: random.rotation() },
    };
  });
  return cloudOf(frame % 2 === 0 ? splats : splats.reverse());
}

test('splats that never change are in the file once, and in every frame', async () => {
  const splatsOf = (bytes: Uint8Array): number => {
    const { groups, still } = parseClip(bytes, 'a.gsv');
    return [...still, ...groups.flatMap(({ parts }) => parts)].reduce((sum, part) => sum + part.splats, 0);
  };
  const once = await clipOf(room, { frames: 30, framesPerGroup: 30 });
  const often = await clipOf(room, { frames: 30, framesPerGroup: 5 });
  assert.deepEqual([once.still, often.still], [0, 380]);
  // Each of the six groups has the 20 splats that move.
  assert.deepEqual([splatsOf(once.bytes), splatsOf(often.bytes)], [400, 380 + 6 * 20]);
  const frameAt = framesOf(often.bytes);
  for (const frame of [0, 4, 5, 17, 29]) {
    const [shown, source] = [await frameAt(frame), room(frame)];
    assert.equal(shown.count, source.count, `frame ${frame}`);
    for (let i = 0; i < source.count; i++) {
      const distances = Array.from({ length: shown.count }, (_, k) =>
        Math.hypot(...[0, 1, 2].map((axis) => shown.positions[3 * k + axis] - source.positions[3 * i + axis])),
      );
      assert.ok(Math.min(...distances) < 0.01, `frame ${frame}, splat ${i}: ${Math.min(...distances)} away`);
    }
  }
});

test('scenes of parts have no codebook values beyond those that they use, and are read like those that have', async () => {
  const cloud = turningBall({ frame: 0, turns: false });
  const encoding = sogOf({ steps: SOG_STEPS, palette: 1024 }, encodeWebp);
  const whole = new Uint8Array(await encoding.write({ cloud, degrees: new Uint8Array(cloud.count).fill(3) }));
  const part = await writePartScene(cloud, encoding);
  assert.ok(part.length < whole.length - 1500, `${part.length} of ${whole.length} bytes`);
  assert.deepEqual(await readScene(part, { name: 'a.sog' }), await readScene(whole, { name: 'a.sog' }));
});

test('harmonics turn with their splats if those of the frames do, over more than a whole turn', async () => {
  for (const turns of [true, false]) {
    const { bytes } = await clipOf((frame) => turningBall({ frame, turns }), { frames: 60, framesPerGroup: 60 });
    const frameAt = framesOf(bytes);
    for (const frame of [0, 11, 40, 59]) {
      const [shown, source] = [await frameAt(frame), turningBall({ frame, turns })];
      let worst = 0;
      for (let i = 0; i < source.count; i++) {
        const apart = Array.from({ length: shown.count }, (_, k) =>
          Math.hypot(...[0, 1, 2].map((axis) => shown.positions[3 * k + axis] - source.positions[3 * i + axis])),
        );
        const k = apart.indexOf(Math.min(...apart));
        for (let n = 0; n < 48; n++) worst = Math.max(worst, Math.abs(shown.sh[48 * k + n] - source.sh[48 * i + n]));
      }
      assert.ok(worst < 0.02, `turns: ${turns}, frame ${frame}: a coefficient differs by ${worst}`);
    }
  }
});
