/** Events that must not lower the quality in motion: single late frames, a search for variants, another tab, a pipeline that is compiled, the low clock of an idle GPU. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { randomSource } from '../support/gpu.js';
import { run, type Frame, type Gpu } from '../support/pace-gpu.js';

const RUNS = 40;
const RUN_MS = 12_000;
const TARGET_MS = (0.8 * 1000) / 60;
/** Frame time of one H100 for 250,000 splats, 1920 x 1080. */
const FAST_MS = 0.6;

type Random = (from: number, to: number) => number;

function gpuOf(seed: number): { random: Random; gpu: Omit<Gpu, 'load'> } {
  const source = randomSource(seed);
  const random: Random = (from, to) => from + (to - from) * source();
  return { random, gpu: { hertz: 60, fixed: 0.2, noise: 0.2, spikes: 0, latency: Math.floor(random(0, 4)), seed } };
}

/** Draws with a GPU that takes 0.6 ms for a frame, plus an additional time, ms, for those that start at a time. */
function draw(name: string, moreOf: (random: Random) => (now: number) => number): void {
  test(`a scene of ${FAST_MS} ms is drawn in full on a page of 60 Hz, for any ${name}`, () => {
    for (let i = 0; i < RUNS; i++) {
      const { random, gpu } = gpuOf(i + 1);
      const more = moreOf(random);
      // No level makes that cheaper.
      let extra = 0;
      const load = (now: number): number => FAST_MS / TARGET_MS + (extra = more(now) / TARGET_MS);
      const shares = (): readonly number[] => [1, ...Array<number>(9).fill(extra > 0 ? 1 : 0.7)];
      const { frames } = run({ ...gpu, fixed: 0, load, shares }, RUN_MS);
      assert.ok(frames.length > 100);
      assert.equal(Math.max(...frames.map(({ level }) => level)), 0, `run ${i}`);
    }
  });
}

draw('single late frames', (random) => () => (random(0, 1) < 1 / 20 ? random(5, 100) : 0));

draw('late frames and the page of another tab that takes the GPU for a second', (random) => {
  const at = random(2_000, 8_000);
  const each = random(15, 250);
  return (now) => (now > at && now < at + 1_000 ? each : random(0, 1) < 1 / 20 ? random(5, 100) : 0);
});

draw('a first frame that is compiled for 300 ms', () => (now) => (now === 0 ? 300 : 0));

draw('a first visit searches for variants', (random) => {
  // A piece that has begun when the motion does, while pipelines of it are compiled; later pieces wait until nothing moves.
  let left = Math.floor(random(1, 3));
  return () => (left-- > 0 ? random(200, 1_000) : 0);
});

test('the low clock of an idle GPU: frames three times slower until it has risen draw less for half a second at most', () => {
  for (let i = 0; i < RUNS; i++) {
    const { random, gpu } = gpuOf(1_000 + i);
    const [length, rest, rise, usual] = [random(1_500, 3_000), random(400, 2_000), random(50, 500), random(0.1, 0.8)];
    const since = (now: number): number => now % (length + rest);
    const load = (now: number): number => usual * (1 + 2 * Math.max(0, 1 - since(now) / rise));
    const { frames } = run({ ...gpu, noise: 0.06, load, moves: (now) => since(now) < length }, 30_000);
    assert.ok(longestReduced(frames) <= 500, `run ${i}: ${longestReduced(frames)} ms of ${rise}, ${usual}`);
  }
});

/** The longest time in a row that was drawn with less, ms. */
function longestReduced(frames: readonly Frame[]): number {
  let [longest, since] = [0, NaN];
  for (const { at, level } of frames) {
    if (level === 0) since = NaN;
    else if (Number.isNaN(since)) since = at;
    else longest = Math.max(longest, at - since);
  }
  return longest;
}

test('a GPU that is slow from some moment on is no other tab: it is drawn with less within a second and a half', () => {
  for (let i = 0; i < RUNS; i++) {
    const { random, gpu } = gpuOf(2_000 + i);
    const slow = random(1.3, 4);
    const { frames } = run({ ...gpu, load: (now) => (now < 3_000 ? FAST_MS / TARGET_MS : slow) }, 6_000);
    const late = frames.filter(({ at }) => at > 4_500);
    assert.ok(
      late.every(({ level }) => level > 0),
      `run ${i}`,
    );
  }
});
