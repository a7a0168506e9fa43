/** Dynamic quality against simulated GPUs: fast, slow, noisy, with a load that steps, at several refresh rates. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import fc from 'fast-check';
import { isLab, someOf } from '../support/extent.js';
import { DisplayInterval, QUALITY_LEVELS, nextQuality, INITIAL_QUALITY } from '../support/element/quality.js';
import { COSTS, LEVELS, p95, restlessWindows, reversals, run } from '../support/pace-gpu.js';

const LOWEST = COSTS.length - 1;
/** The end of the dead band, and the noise of times within it. */
const TOLERANCE = 1.1;

const STEP_MS = 6_000;
const anyGpu = {
  hertz: fc.constantFrom(60, 90, 120, 144),
  fixed: fc.double({ min: 0, max: 0.25, noNaN: true }),
  latency: fc.integer({ min: 0, max: 3 }),
  seed: fc.integer({ min: 1, max: 1e6 }),
};

test('load steps: in time within a second, turning at most once in five', () => {
  const loads = fc.record({
    ...anyGpu,
    before: fc.double({ min: 0.1, max: 2.5, noNaN: true }),
    after: fc.double({ min: 0.1, max: 3, noNaN: true }),
  });
  fc.assert(
    fc.property(loads, ({ before, after, ...gpu }) => {
      const load = (now: number): number => (now < STEP_MS ? before : after);
      const { frames } = run({ ...gpu, load, noise: 0.06, spikes: 0 }, 2 * STEP_MS);
      for (const start of [0, STEP_MS]) {
        const found = p95(frames, start + 1_000, start + STEP_MS);
        assert.ok(found <= TOLERANCE, `p95 is ${found} of the target`);
        // The step itself may turn the level, and that is the one.
        assert.ok(reversals(frames, start, start + 5_000) <= 1, `${reversals(frames, start, start + 5_000)} reversals`);
      }
    }),
    { numRuns: isLab ? 120 : 40, seed: 5 },
  );
});

/**
 * Times of an H200 for the skull close up, 1920 x 1080 (docs/decisions/0014); and for a frame so small that fewer
 * pixels leave most of such a GPU idle.
 */
const WIDE = [1, 0.81, 0.75, 0.74, 0.67, 0.62, 0.59, 0.59, 0.59, 0.64];
const SMALL = [1, 0.95, 0.93, 1, 1.05, 1.1, 1.2, 1.3, 1.5, 1.9];

test('a wide GPU, where fewer pixels win little: load steps are kept to as on others', () => {
  const loads = fc.record({
    ...anyGpu,
    before: fc.double({ min: 0.1, max: 1.3, noNaN: true }),
    after: fc.double({ min: 0.1, max: 1.5, noNaN: true }),
  });
  fc.assert(
    fc.property(loads, ({ before, after, ...gpu }) => {
      const load = (now: number): number => (now < STEP_MS ? before : after);
      const { frames } = run({ ...gpu, fixed: 0, shares: () => WIDE, load, noise: 0.06, spikes: 0 }, 2 * STEP_MS);
      const found = p95(frames, STEP_MS + 1_000, 2 * STEP_MS);
      assert.ok(found <= TOLERANCE, `p95 is ${found} of the target`);
      assert.ok(reversals(frames, STEP_MS, STEP_MS + 5_000) <= 1, 'reversals');
    }),
    { numRuns: isLab ? 60 : 20, seed: 7 },
  );
});

test('a frame becomes so small that fewer pixels take longer than all: the accurate frame comes back, though no higher level seemed fast enough', () => {
  for (const [load, fixed] of [
    [0.48, 0],
    [0.58, 0],
    [0.7, 0.1],
  ]) {
    const gpu = { hertz: 60, fixed, noise: 0.06, spikes: 0, latency: 2, seed: 11 };
    const isLarge = (now: number): boolean => now < 8_000;
    const { frames } = run(
      { ...gpu, load: (now) => (isLarge(now) ? 2.2 : load), shares: (now) => (isLarge(now) ? WIDE : SMALL) },
      26_000,
    );
    // The sixth takes 1.05 of the time of the lowest level, which is no longer by the law's tolerance.
    assert.ok(frames.find(({ at }) => at > 8_000)!.level >= 5, 'the large one takes the lowest levels');
    const levels = frames.filter(({ at }) => at > 22_000).map(({ level }) => level);
    assert.ok(
      levels.every((level) => level === 0),
      `load ${load}: ${levels.join(' ')}`,
    );
  }
});

test('a lower level that makes frames longer is reverted at once, and is not tried again for long', () => {
  for (const latency of [0, 1, 2, 3]) {
    const gpu = { hertz: 60, fixed: 0, shares: () => SMALL, noise: 0.06, spikes: 0, latency, seed: 12 };
    const { frames } = run({ ...gpu, load: (now) => (now < 2_000 ? 0.5 : 1.5) }, 8_000);
    const after = frames.filter(({ at }) => at > 2_000);
    assert.ok(
      after.some(({ level }) => level > 0),
      'less is tried',
    );
    assert.ok(after.filter(({ level }) => SMALL[level] > 1.25).length < 12, 'frames that were the worse for it');
    assert.ok(reversals(frames, 2_000, 7_000) <= 1, `${reversals(frames, 2_000, 7_000)} reversals`);
  }
});

test('where the first levels win next to nothing and those far below much, these are found within a second', () => {
  for (const won of [0, 0.02, 0.04]) {
    const first = [1, 1 - won, 1 - won, 1 - won];
    const shares = [...first, 0.87, 0.73, 0.63, 0.55, 0.52, 0.52];
    for (let seed = 1; seed <= 20; seed++) {
      const gpu = { hertz: 60, fixed: 0, shares: () => shares, noise: 0.06, spikes: 0, latency: seed % 4, seed };
      const { frames } = run({ ...gpu, load: (now) => (now < STEP_MS ? 0.6 : 1.85) }, 2 * STEP_MS);
      const found = p95(frames, STEP_MS + 1_000, 2 * STEP_MS);
      assert.ok(found <= TOLERANCE, `${won}, seed ${seed}: p95 is ${found} of the target`);
      const turns = reversals(frames, STEP_MS, STEP_MS + 5_000);
      assert.ok(turns <= 1, `${won}, seed ${seed}: ${turns} reversals`);
    }
  }
});

test('if no level gains anything the frame stays full, or returns to it at once and stays', () => {
  for (const [load, latency] of [
    [1.3, 0],
    [2.5, 2],
    [6, 3],
  ]) {
    const gpu = { hertz: 60, fixed: 1, noise: 0.06, spikes: 0, latency, seed: 13 };
    const { frames } = run({ ...gpu, load: () => load }, 30_000);
    const late = frames.filter(({ at }) => at > 4_000);
    assert.ok(
      late.every(({ level }) => level === 0),
      `load ${load}: ${late.map(({ level }) => level).join(' ')}`,
    );
    assert.ok(reversals(frames, 0, 5_000) <= 1, `${reversals(frames, 0, 5_000)} reversals`);
  }
});

test('levels that are each a little dearer than the one below are not climbed one after the other where the lowest is too slow', () => {
  const shares = COSTS.map((_, level) => 1.04 ** (LOWEST - level));
  const gpu = { hertz: 60, fixed: 0, shares: () => shares, load: () => 1.2, noise: 0, spikes: 0, latency: 2, seed: 1 };
  const levels = run(gpu, 30_000).frames.map(({ at, level }) => (at < 1_000 ? LOWEST : level));
  assert.ok(
    levels.every((level) => level >= LOWEST - 3),
    `${Math.min(...levels)}`,
  );
});

test('noise and spikes: the usual frame misses no refresh of the display, and the level stays constant', () => {
  fc.assert(
    fc.property(fc.record({ ...anyGpu, load: fc.double({ min: 0.2, max: 3, noNaN: true }) }), ({ load, ...gpu }) => {
      const { frames } = run({ ...gpu, load: () => load, noise: 0.2, spikes: 1.5 }, 20_000);
      const found = p95(frames, 1_000, 20_000);
      // The target leaves a quarter of itself to the display's interval.
      assert.ok(found <= 1.25, `p95 is ${found} of the target`);
      for (let start = 0; start < 15_000; start += 1_000) {
        assert.ok(reversals(frames, start, start + 5_000) <= 1, `${reversals(frames, start, start + 5_000)} reversals`);
      }
    }),
    { numRuns: isLab ? 60 : 20, seed: 6 },
  );
});

test('a fast GPU draws the accurate frame, on any display, with single slow frames or not', () => {
  for (const hertz of [60, 120, 144]) {
    const { frames } = run({ hertz, load: () => 0.3, fixed: 0.2, noise: 0.2, spikes: 3, latency: 2, seed: 9 }, 30_000);
    assert.ok(frames.every(({ level }) => level === 0));
  }
});

test('a GPU that is too slow for all comes to the lowest level within few frames and stays', () => {
  const { frames } = run({ hertz: 60, load: () => 60, fixed: 0, noise: 0.1, spikes: 0, latency: 2, seed: 3 }, 60_000);
  const levels = frames.slice(6).map(({ level }) => level);
  assert.ok(levels.filter((level) => level === LOWEST).length > 0.95 * levels.length, levels.join(' '));
  assert.ok(
    levels.every((level) => level >= LOWEST - 1),
    levels.join(' '),
  );
});

test('a GPU that is far too slow, with much that no level makes cheaper, turns at most once in five seconds', () => {
  for (const load of [20, 40]) {
    for (const seed of [1, 2, 3]) {
      const gpu = { hertz: 60, load: () => load, fixed: 0.3, noise: 0.1, spikes: 0, latency: 2, seed };
      const { frames } = run(gpu, 60_000);
      for (let start = 0; start < 55_000; start += 500) {
        const found = reversals(frames, start, start + 5_000);
        assert.ok(found <= 1, `load ${load}: ${found} reversals after ${start} ms`);
      }
    }
  }
});

test('where the lowest levels are no faster and still too slow, the level turns at most once in five seconds', () => {
  // Two steps of an H200 (docs/benchmark.md), and frames with a part that no level makes cheaper.
  const measured = [
    [1, 0.93, 0.92, 0.88, 0.73, 0.58, 0.58, 0.58, 0.58, 0.59],
    [1, 0.99, 0.99, 0.97, 0.96, 0.95, 0.95, 0.96, 0.98, 1.04],
  ];
  const floors = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9].map((floor) => COSTS.map((cost) => Math.max(floor, cost)));
  let [restless, all] = [0, 0];
  for (const shares of [...measured, ...floors]) {
    for (const lowest of [1.06, 1.12, 1.2, 1.4, 1.7, 2.2]) {
      for (const seed of someOf([1, 2, 3, 4, 5, 6, 7, 8], 2)) {
        const load = lowest / Math.min(...shares);
        const gpu = {
          hertz: 60,
          load: () => load,
          fixed: 0,
          shares: () => shares,
          noise: 0.04,
          spikes: 0.5,
          latency: 1,
          seed,
        };
        const { frames } = run(gpu, 30_000);
        restless += restlessWindows(frames);
        all++;
      }
    }
  }
  console.log(`${restless} times sooner than five seconds after the last turn, in ${all} runs of 30 s`);
  assert.equal(restless, 0);
});

test('when the load is gone the whole image comes back within a second, without a detour', () => {
  const load = (now: number): number => (now < 5_000 ? 4 : 0.2);
  const { frames } = run({ hertz: 60, load, fixed: 0.2, noise: 0.1, spikes: 0, latency: 2, seed: 4 }, 15_000);
  const after = frames.filter(({ at }) => at > 5_000);
  for (let k = 1; k < after.length; k++) {
    assert.ok(after[k].level <= after[k - 1].level, 'no way down');
  }
  assert.ok(after.filter(({ at }) => at > 6_000).every(({ level }) => level === 0));
});

test('a level that costs more than the table predicts is tried again once in two minutes', () => {
  // The first level down makes the frame more than twice as fast, although the levels promise less.
  const targetMs = 13.3;
  let quality = INITIAL_QUALITY;
  const changes: number[] = [];
  for (let now = 0; now < 600_000; now += 16.7) {
    const { level } = quality;
    const milliseconds = targetMs * (level === 0 ? 1.3 : 0.5);
    quality = nextQuality(quality, { now, level, milliseconds }, { targetMs, levels: LEVELS });
    if (quality.level === 0 && level > 0) changes.push(now);
  }
  assert.ok(changes.length >= 3 && changes.length <= 5, changes.join(' '));
  const gaps = changes.slice(1).map((at, i) => at - changes[i]);
  assert.ok(
    gaps.every((gap) => gap >= 115_000),
    gaps.join(' '),
  );
});

test('frames that took next to nothing do not keep belief low: slow ones are answered within a second and a half', () => {
  const rules = { targetMs: 13, levels: LEVELS };
  let quality = INITIAL_QUALITY;
  let now = 0;
  // Past a corner of the scene, with no splat in view.
  for (; now < 2_000; now += 16)
    quality = nextQuality(quality, { now, level: quality.level, milliseconds: 0.01 }, rules);
  const begin = now;
  for (; quality.level === 0 && now < begin + 10_000; now += 60)
    quality = nextQuality(quality, { now, level: quality.level, milliseconds: 60 }, rules);
  assert.ok(now - begin < 1_500, `answered after ${now - begin} ms`);
});

test('frames of another level say nothing', () => {
  const quality = { ...INITIAL_QUALITY, level: 3 };
  assert.equal(
    nextQuality(quality, { now: 0, level: 0, milliseconds: 500 }, { targetMs: 13, levels: LEVELS }),
    quality,
  );
});

test('if lower levels take longer, the level returns by the time of the accurate frame at rest', () => {
  const targetMs = 13.3;
  let [quality, now] = [INITIAL_QUALITY, 0];
  const draw = (level: number, milliseconds: number): void => {
    quality = nextQuality(quality, { now: (now += 16.7), level, milliseconds }, { targetMs, levels: LEVELS });
  };
  const move = (seconds: number, shares: readonly number[], load: number): void => {
    for (const end = now + 1000 * seconds; now < end;) draw(quality.level, targetMs * load * shares[quality.level]);
  };
  move(8, COSTS, 2);
  assert.ok(quality.level >= 3, `${quality.level}`);
  // The element becomes small: all levels are too slow, and the full frame is the fastest.
  move(4, SMALL, 5);
  const { level } = quality;
  assert.ok(level > 4, `${level}`);
  draw(0, targetMs * 5);
  move(2, SMALL, 5);
  // Within 5 % of the fastest.
  assert.ok(quality.level <= 1, `${quality.level}`);
  // At rest it took less than in motion: that was measured, and counts.
  move(8, COSTS, 2);
  const settled = quality.level;
  assert.ok(settled >= 3, `${settled}`);
  draw(0, targetMs * 0.5);
  move(6, COSTS, 2);
  assert.equal(quality.level, settled);
});

test("the element's levels: the whole image, then others by their names, whose scale is the one that is drawn", () => {
  assert.deepEqual([QUALITY_LEVELS[0].settings, QUALITY_LEVELS[0].scale], [undefined, 1]);
  assert.equal(new Set(QUALITY_LEVELS.map(({ name }) => name)).size, QUALITY_LEVELS.length);
  for (const { settings, scale } of QUALITY_LEVELS.slice(1)) assert.equal(settings?.resolutionScale ?? 1, scale);
});

test('the display: refresh rates are found among late frames, and slow frames are not taken for a slow display', () => {
  const seen = (steps: readonly number[]): number => {
    const display = new DisplayInterval();
    let now = 1000;
    display.tick(now);
    for (const step of steps) display.tick((now += step));
    return display.milliseconds;
  };
  const late = (ms: number, k: number): number => (k % 3 === 0 ? 2 * ms : ms);
  for (const hertz of [60, 75, 120, 144, 240, 360, 480, 540]) {
    const ms = 1000 / hertz;
    assert.ok(Math.abs(seen(Array.from({ length: 40 }, (_, k) => late(ms, k))) - ms) < 0.01, `${hertz} Hz`);
  }
  assert.equal(seen(Array(40).fill(50)), 1000 / 60);
  assert.equal(seen([]), 1000 / 60);
  // Several elements draw at one moment.
  assert.equal(seen(Array.from({ length: 40 }, (_, k) => (k % 2 === 0 ? 0 : 8))), 8);
});
