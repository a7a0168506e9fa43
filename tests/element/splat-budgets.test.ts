/** Splat budgets of streamed scenes that follow the headroom of frames: the real controller and a simulated GPU. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import fc from 'fast-check';
import { MemoryLedger } from '@gaussian-splat/renderer';
import { budgetBytes } from '@gaussian-splat/renderer/tools';
import type { FrameScheduler } from '../support/element/parts.js';
import { DynamicQualityController, type BudgetedScene, type FramePlan } from '../support/element/quality.js';
import { randomSource } from '../support/gpu.js';
import { LEVELS, reversals } from '../support/pace-gpu.js';

const INTERVAL = 1000 / 60;
const TARGET = 0.8 * INTERVAL;
const [BASE, MAX] = [3e6, 20e6];

interface Flight {
  /** Time of a frame that draws no splat, and time of a million splats, ms. */
  readonly fixedMs?: number;
  readonly perMillion: (now: number) => number;
  /** Number of splats that the view needs within a pixel. */
  readonly needed?: (now: number) => number;
  /** Error of missing pages, px. */
  readonly missing?: (now: number) => number;
  readonly range?: readonly [number, number];
  readonly ledger?: MemoryLedger;
  /** Relative spread of times. */
  readonly noise?: number;
  readonly isOn?: (now: number) => boolean;
}

interface Frame {
  readonly at: number;
  readonly level: number;
  readonly splatBudget: number;
  readonly milliseconds: number;
}

/** Flies for some time, with times that are known two frames later. Ends the control. */
function fly(flight: Flight, milliseconds: number): { readonly frames: Frame[]; readonly after: number | undefined } {
  const { fixedMs = 1.5, perMillion, needed = () => MAX, range = [BASE, MAX], noise = 0 } = flight;
  let now = 0;
  let budgetError = 0;
  const scene: BudgetedScene = {
    place: { memory: flight.ledger ?? new MemoryLedger() },
    gaussians: {
      progress: {
        get error() {
          return flight.missing?.(now) ?? 0;
        },
        get budgetError() {
          return budgetError;
        },
      },
    },
    detail: { detail: 1, splatBudget: range[0], splatRange: range },
    setDetail(detail) {
      Object.assign(scene, { detail });
    },
  };
  const controller = new DynamicQualityController({
    isOn: () => flight.isOn?.(now) ?? true,
    scheduler: () => ({ displayInterval: INTERVAL, clients: 1 }) as FrameScheduler,
    frameBudget: () => Infinity,
    requestFrame: () => undefined,
    mayFade: () => false,
    onFrameTimed: () => undefined,
    scenes: () => [scene],
    levels: LEVELS,
  });
  const random = randomSource(3);
  const frames: Frame[] = [];
  const flying: { readonly plan: FramePlan; readonly time: number }[] = [];
  for (; now < milliseconds; now += INTERVAL) {
    const plan = controller.plan({ now, pixels: 2e6, hasChanged: true, goesOn: true });
    const { splatBudget = 0 } = scene.detail;
    const drawn = Math.min(splatBudget, needed(now));
    const share = LEVELS[plan.level].scale ** 2;
    const time = share * (fixedMs + (perMillion(now) * drawn) / 1e6) * (1 + noise * (random() + random() - 1));
    budgetError = needed(now) > splatBudget ? needed(now) / splatBudget : 0;
    frames.push({ at: now, level: plan.level, splatBudget, milliseconds: time });
    flying.push({ plan, time });
    if (flying.length < 3) continue;
    const { plan: timed, time: known } = flying.shift()!;
    controller.sample(timed, { doneAt: now, lowerBound: known, upperBound: known });
  }
  controller.stop();
  return { frames, after: scene.detail.splatBudget };
}

/** Number of changes of the budget. */
const changes = (frames: readonly Frame[]): number =>
  frames.filter(({ splatBudget }, i) => i > 0 && splatBudget !== frames[i - 1].splatBudget).length;

/** The same frames with the budget in place of the quality level, to count reversals. */
const budgetsOf = (frames: readonly Frame[]) =>
  frames.map(({ at, splatBudget }) => ({ at, level: splatBudget, share: 1 }));

test('a budget grows within a second to what the time of a frame allows, without a late frame, and then stays', () => {
  // Times of an H200: 5.6 ms for three million.
  const { frames, after } = fly({ perMillion: () => 1.37 }, 6_000);
  const last = frames.at(-1)!;
  console.log(`${changes(frames)} steps to ${last.splatBudget} splats, ${last.milliseconds.toFixed(1)} ms`);
  assert.ok(last.splatBudget > 2 * BASE && last.splatBudget < 2.5 * BASE);
  assert.ok(frames.every(({ milliseconds, level }) => milliseconds <= TARGET && level === 0));
  assert.ok(changes(frames) <= 4, 'few allocations');
  assert.equal(frames.find(({ at }) => at >= 1_000)!.splatBudget, last.splatBudget);
  assert.equal(after, BASE, 'the end of the control');
});

test('a budget that limits no view stays, as does a named one, and that of a page with a fixed quality', () => {
  const all = [
    fly({ perMillion: () => 0.2, needed: () => 2.9e6 }, 3_000),
    fly({ perMillion: () => 0.2, range: [2e6, 2e6] }, 3_000),
    fly({ perMillion: () => 0.2, isOn: () => false }, 3_000),
    fly({ perMillion: () => 8 }, 3_000),
  ];
  assert.deepEqual(
    all.map(({ frames }) => changes(frames)),
    [0, 0, 0, 0],
  );
  assert.ok(all[3].frames.at(-1)!.level > 0, 'on a slow GPU the quality falls as without budgets');
  const { frames } = fly({ perMillion: () => 1, isOn: (now) => now < 2_000 }, 4_000);
  assert.ok(frames.find(({ at }) => at > 1_900)!.splatBudget > BASE);
  assert.ok(
    frames.every(({ at, splatBudget }) => at < 2_050 || splatBudget === BASE),
    'the quality became fixed',
  );
});

test('a budget stays while missing pages have the larger error, and grows once they have arrived', () => {
  const { frames } = fly({ perMillion: () => 0.5, missing: (now) => (now < 2_000 ? 9 : 0) }, 4_000);
  assert.ok(frames.every(({ at, splatBudget }) => at > 2_000 || splatBudget === BASE));
  assert.ok(frames.at(-1)!.splatBudget > 2 * BASE);
});

test('frames become slower: the budget falls to what is in time, and the quality stays', () => {
  const { frames } = fly({ perMillion: (now) => (now < 3_000 ? 1 : 2.2) }, 9_000);
  const [before, last] = [frames.find(({ at }) => at > 2_900)!, frames.at(-1)!];
  console.log(`${before.splatBudget} splats, then ${last.splatBudget}`);
  assert.ok(last.splatBudget < before.splatBudget && last.splatBudget > BASE);
  assert.ok(frames.every(({ level }) => level === 0));
  const late = frames.filter(({ milliseconds }) => milliseconds > TARGET);
  assert.ok(late.length < 12 && late.every(({ at }) => at < 3_300), `${late.length} late frames`);
  assert.ok(reversals(budgetsOf(frames), 3_000, 8_000) <= 1);
});

test('with any GPU, noise and steps of the load, a budget turns at most once in five seconds', () => {
  const gpu = {
    fixedMs: fc.double({ min: 0, max: 4, noNaN: true }),
    before: fc.double({ min: 0.1, max: 3, noNaN: true }),
    after: fc.double({ min: 0.1, max: 3, noNaN: true }),
    noise: fc.double({ min: 0, max: 0.15, noNaN: true }),
  };
  fc.assert(
    fc.property(fc.record(gpu), ({ fixedMs, before, after, noise }) => {
      const { frames } = fly({ fixedMs, noise, perMillion: (now) => (now < 6_000 ? before : after) }, 12_000);
      for (const start of [0, 6_000]) {
        const turns = reversals(budgetsOf(frames), start, start + 5_000);
        assert.ok(turns <= 1, `${turns} turns`);
      }
      assert.ok(frames.every(({ splatBudget }) => splatBudget >= BASE && splatBudget <= MAX));
      const late = frames.filter(({ at, milliseconds }) => at % 6_000 > 1_000 && milliseconds > 1.15 * TARGET);
      assert.ok(late.length <= 0.02 * frames.length, `${late.length} late frames`);
    }),
    { numRuns: 60, seed: 4 },
  );
});

test('the buffers of larger budgets take at most half of the memory that the page has left, and give it back', () => {
  const ledger = new MemoryLedger();
  ledger.budgetBytes = 6e8;
  const scene = ledger.reserve('pages of a streamed scene', 3e8);
  const { frames } = fly({ perMillion: () => 0.2, ledger }, 4_000);
  const extra = budgetBytes(frames.at(-1)!.splatBudget) - budgetBytes(BASE);
  console.log(`${frames.at(-1)!.splatBudget} splats, ${(extra / 1e6).toFixed(1)} MB more`);
  assert.ok(extra > 5e7 && extra <= 1.5e8);
  assert.equal(ledger.bytes, 3e8, 'only the pages are left');
  scene.release();
});
