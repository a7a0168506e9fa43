/** When the true image comes, once a picture rests: the controller itself, with a clock of the test's and a GPU that is a figure. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { DetailController } from '../../packages/element/src/controllers/detail-controller.js';
import {
  DynamicQualityController,
  type FramePlan,
  type DynamicQualityOptions,
} from '../../packages/element/src/controllers/dynamic-quality-controller.js';
import { FrameScheduler } from '../../packages/element/src/gpu/frame-scheduler.js';
import type { LoadedGaussians } from '../../packages/element/src/gpu/loaded-gaussians.js';
import type { SceneLoader } from '../../packages/element/src/loading/scene-loader.js';
import { waitForRest } from '../../packages/element/src/dynamic-quality/start.js';
import { COSTS, LEVELS } from '../support/pace-gpu.js';

const INTERVAL = 1000 / 60;
const PIXELS = 1e6;
const display = { displayInterval: INTERVAL, clients: 1 } as FrameScheduler;

/** A controller that is on, alone on its display, and goes by that; but for what a test says. */
const paceOf = (options: Partial<DynamicQualityOptions> = {}): DynamicQualityController =>
  new DynamicQualityController({
    isOn: () => true,
    scheduler: () => display,
    frameBudget: () => Infinity,
    requestFrame: () => undefined,
    mayFade: () => true,
    onFrameTimed: () => undefined,
    levels: LEVELS,
    ...options,
  });

/** What a frame took that began at a time, known exactly. */
const took = (
  pace: DynamicQualityController,
  plan: Pick<FramePlan, 'level' | 'size'>,
  milliseconds: number,
  now: number,
): void => pace.sample(plan, { doneAt: now + milliseconds, lowerBound: milliseconds, upperBound: milliseconds });

for (const wholeMs of [20, 100, 200, 214]) {
  test(`a true image of ${wholeMs} ms is on show 300 ms after rest, and not begun before 50 ms`, (context) => {
    context.mock.timers.enable({ apis: ['setTimeout'] });
    let asked = false;
    const pace = paceOf({ requestFrame: () => (asked = true) });
    // A motion that is drawn whole at first, and soon no longer.
    let now = 1000;
    for (let frame = 0; frame < 60; frame++, now += INTERVAL) {
      const plan = pace.plan({ now, pixels: PIXELS, hasChanged: true, goesOn: true });
      const { level } = plan;
      took(pace, plan, level === 0 ? wholeMs : 10, now);
    }
    const plan = pace.plan({ now, pixels: PIXELS, hasChanged: true, goesOn: false });
    const { level } = plan;
    assert.ok(level > 0, 'in motion with less');
    assert.equal(asked, false);
    let waited = 0;
    for (; !asked && waited < 1000; waited++) context.mock.timers.tick(1);
    assert.ok(waited >= 50 && waited <= 150, `begun after ${waited} ms`);
    // The hand stopped up to an interval before what it did was drawn.
    const shown = INTERVAL + waited + INTERVAL + wholeMs;
    assert.ok(shown <= 300, `on show after ${shown} ms`);
    assert.equal(
      pace.plan({ now: now + waited, pixels: PIXELS, hasChanged: false, goesOn: false }).level,
      0,
      'the true image',
    );
    // A hand that goes on right away moves as it did.
    assert.ok(pace.plan({ now: now + waited + 5, pixels: PIXELS, hasChanged: true, goesOn: true }).level > 0);
    pace.stop();
  });
}

test('true images that can not be in time are begun as soon as rest can be told, those of unknown time as late as may be', () => {
  assert.equal(waitForRest(900, INTERVAL), 50);
  assert.equal(waitForRest(0, INTERVAL), 150);
});

test('what a frame may take is what the page says, else a share of the display that elements divide', () => {
  const scheduler = { displayInterval: INTERVAL, clients: 2 } as FrameScheduler;
  let budget = Infinity;
  const pace = paceOf({ scheduler: () => scheduler, frameBudget: () => budget });
  assert.equal(pace.targetMs, (0.8 * INTERVAL) / 2);
  for (budget of [2, 40]) {
    assert.equal(pace.targetMs, budget);
    // A frame that the page has room for, and then one that it has not.
    for (const [share, falls] of [
      [0.9, false],
      [5, true],
    ] as const) {
      pace.reset();
      for (let now = 1000; now < 2000; now += INTERVAL) took(pace, { level: 0, size: 0 }, share * budget, now);
      assert.equal(pace.report.moving !== 'whole', falls, `${share} of ${budget} ms`);
    }
  }
});

/** A display that the test drives: a picture every interval. */
function drivenDisplay(): { now: () => number; picture: () => void; restore: () => void } {
  const page = globalThis as unknown as Record<string, unknown>;
  const { requestAnimationFrame, document } = page;
  const waiting: ((now: number) => void)[] = [];
  page.requestAnimationFrame = (draw: (now: number) => void) => waiting.push(draw);
  page.document = { visibilityState: 'visible' };
  let now = 1000;
  return {
    now: () => now,
    picture: () => {
      now += INTERVAL;
      for (const draw of waiting.splice(0)) draw(now);
    },
    restore: () => void Object.assign(page, { requestAnimationFrame, document }),
  };
}

test('an element that draws now and then leaves others all but their whole time; two that both move share it within a second, and one alone has it at once', (context) => {
  const { now, picture, restore } = drivenDisplay();
  context.mock.method(performance, 'now', now);
  const scheduler = new FrameScheduler();
  const ignored = (): void => undefined;
  const pace = paceOf({ scheduler: () => scheduler });
  const levels: number[] = [];
  // Its frames take 0.7 of what it may.
  const moving = {
    drawFrame: (now: number) => {
      const plan = pace.plan({ now, pixels: PIXELS, hasChanged: true, goesOn: true });
      const { level } = plan;
      levels.push(level);
      took(pace, plan, 0.7 * 0.8 * INTERVAL * COSTS[level], now);
    },
  };
  const other = { drawFrame: ignored };
  for (let k = 0; k < 240; k++) {
    scheduler.request(moving);
    if (k % 12 === 0) scheduler.request(other);
    picture();
  }
  assert.equal(Math.max(...levels), 0, `levels ${levels.join(' ')}`);
  for (let k = 0; k < 60; k++) {
    scheduler.request(moving);
    scheduler.request(other);
    picture();
  }
  assert.ok(Math.abs(pace.targetMs / (0.4 * INTERVAL) - 1) < 0.03, `${pace.targetMs} ms`);
  assert.ok(levels.at(-1)! > 0, 'half of the time is too little for the whole picture');
  // A window that is resized draws all of its elements, frame after frame; then one is turned.
  const still = Array.from({ length: 8 }, () => ({ drawFrame: ignored }));
  for (let k = 0; k < 60; k++) {
    for (const each of still) scheduler.request(each);
    picture();
  }
  pace.reset();
  levels.length = 0;
  for (let k = 0; k < 30; k++) {
    scheduler.request(moving);
    picture();
  }
  assert.equal(Math.max(...levels), 0, `levels ${levels.join(' ')}`);
  pace.stop();
  restore();
});

test('pictures that are small already are not made smaller, whatever they take', () => {
  const pace = paceOf();
  const levelOf = (pixels: number): number => {
    for (let now = 1000; now < 3000; now += INTERVAL) {
      const plan = pace.plan({ now, pixels, hasChanged: true, goesOn: true });
      const { level } = plan;
      took(pace, plan, 1000 * COSTS[level], now);
    }
    return pace.plan({ now: 3000, pixels, hasChanged: true, goesOn: true }).level;
  };
  const scaleOf = (level: number): number => LEVELS[level].settings?.resolutionScale ?? 1;
  for (const side of [32, 128, 256, 1024]) {
    pace.reset();
    const scale = scaleOf(levelOf(side ** 2));
    assert.ok(scale === 1 || (scale * side) ** 2 >= 8192, `${scale} of ${side}`);
    assert.equal(scale < 1, side > 100, `${scale} of ${side}`);
  }
  assert.ok(
    scaleOf(levelOf(1024 ** 2)) < scaleOf(levelOf(128 ** 2)),
    'a picture that shrinks takes what was chosen back',
  );
});

test('an element of another size is measured anew: that fewer pixels won nothing of a small picture says nothing of a large one', () => {
  let now = 1000;
  const pace = paceOf();
  const move = (seconds: number, pixels: number, takes: (level: number) => number): number => {
    let last = 0;
    for (const end = now + 1000 * seconds; now < end; now += INTERVAL) {
      const plan = pace.plan({ now, pixels, hasChanged: true, goesOn: true });
      const { level } = plan;
      last = takes(level);
      took(pace, plan, last, now);
    }
    return last;
  };
  move(20, 2e5, () => 18);
  assert.equal(pace.plan({ now, pixels: 2e5, hasChanged: true, goesOn: true }).level, 0, 'the small one is whole');
  assert.ok(move(1, 4e6, (level) => 20 * COSTS[level]) <= pace.targetMs, 'the large one is in time within a second');
  // On the lowest level that a small picture may have, where all of it is faster.
  move(5, 4e6, (level) => 20 * COSTS[level]);
  move(2, 4e6, (level) => 60 * COSTS[level]);
  const smallMs = [18, 18, 19, 24, 32];
  assert.ok(move(0.5, 17_000, (level) => smallMs[level]) < 32, 'the small one does not wait to be more of itself');
  assert.ok(move(2, 17_000, (level) => smallMs[level]) < 20, 'the small one comes back to what is faster');
  pace.stop();
});

test('an element that becomes smaller in motion shows as many pixels as before at once, not the few that the large one could afford', () => {
  let now = 1000;
  const pace = paceOf();
  const move = (seconds: number, pixels: number, share: (level: number) => number): number[] => {
    const levels: number[] = [];
    for (const end = now + 1000 * seconds; now < end; now += INTERVAL) {
      const plan = pace.plan({ now, pixels, hasChanged: true, goesOn: true });
      const { level } = plan;
      levels.push(level);
      took(pace, plan, pace.targetMs * share(level), now);
    }
    return levels;
  };
  const [large, small] = [3072 * 1728, 1344 * 756];
  const before = move(3, large, (level) => 8 * COSTS[level]).at(-1)!;
  assert.ok(COSTS[before] <= 1 / 8, LEVELS[before].name);
  // What an H200 took: a picture so small leaves it idle when it is made smaller still, and no level spares enough for a climb.
  const taken = [0.76, 0.72, 0.7, 0.66, 0.62, 0.66, 0.8, 0.9, 0.96, 1.04];
  const [first, ...after] = move(8, small, (level) => taken[level]);
  assert.ok(COSTS[first] * small <= COSTS[before] * large, `${LEVELS[first].name}: more than before`);
  assert.ok(COSTS[first - 1] * small > COSTS[before] * large, `${LEVELS[first].name}: fewer than before`);
  assert.equal(after.at(-1), 0, after.join(' '));
  pace.stop();
});

test('a scene that changes in every other picture of the display is in motion in those between, and rests as a camera does', (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  const asked: number[] = [];
  let now = 1000;
  const pace = paceOf({ requestFrame: () => void asked.push(now) });
  const frame = (hasChanged: boolean): number => {
    const plan = pace.plan({ now, pixels: PIXELS, hasChanged, goesOn: false });
    const { level } = plan;
    took(pace, plan, 100 * COSTS[level], now);
    return level;
  };
  const levels: number[] = [];
  for (let k = 0; k < 120; k++) {
    levels.push(frame(k % 2 === 0));
    context.mock.timers.tick(INTERVAL);
    now += INTERVAL;
  }
  const between = levels.slice(60).filter((_, k) => k % 2 === 1);
  assert.ok(Math.min(...between) > 0, `levels ${levels.slice(60).join(' ')}`);
  assert.deepEqual(asked, [], 'no rest is looked for between');
  // The last change: what is drawn besides does not put rest off.
  for (let waited = 0; asked.length === 0 && waited < 300; waited += INTERVAL) {
    assert.ok(frame(false) > 0, 'not yet at rest');
    context.mock.timers.tick(INTERVAL);
    now += INTERVAL;
  }
  assert.ok(asked.length === 1, 'rest is looked for');
  assert.equal(frame(false), 0, 'the true image');
  pace.stop();
});

test('a change that comes while the true image of a pause is drawn belongs to the motion before', (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  const pace = paceOf();
  const plan = (now: number, hasChanged: boolean): FramePlan =>
    pace.plan({ now, pixels: PIXELS, hasChanged, goesOn: false });
  let now = 1000;
  for (let k = 0; k < 30; k++, now += 50) {
    const frame = plan(now, true);
    took(pace, frame, frame.level === 0 ? 300 : 60, now);
  }
  context.mock.timers.tick(200);
  assert.equal(plan(now, false).level, 0, 'the true image is begun');
  // It takes 300 ms, and that is not known yet.
  assert.ok(plan(now + 310, true).level > 0, 'the hand goes on');
  pace.stop();
});

test('what was measured before the page chose a quality is not told, and not believed afterwards', () => {
  let isOn = true;
  const pace = paceOf({ isOn: () => isOn });
  const frame = { pixels: PIXELS, hasChanged: true, goesOn: true };
  for (let now = 1000; now < 2000; now += INTERVAL) {
    const plan = pace.plan({ now, ...frame });
    const { level } = plan;
    took(pace, plan, 80 * COSTS[level], now);
  }
  assert.ok(pace.report.moving !== 'whole' && pace.report.lastMs !== null);
  const late = pace.plan({ now: 1990, ...frame });
  isOn = false;
  assert.equal(pace.plan({ now: 2000, ...frame }).level, 0);
  // A frame of before is known only now.
  took(pace, late, 80, 1990);
  const { drawn, moving, reason, frameMs, lastMs } = pace.report;
  assert.deepEqual([drawn, moving, reason, frameMs, lastMs], ['whole', 'whole', 'start', null, null]);
  pace.stop();
});

test('what a frame took that was drawn in another size says nothing', () => {
  const pace = paceOf();
  const plan = (pixels: number): FramePlan => pace.plan({ now: 1000, pixels, hasChanged: true, goesOn: true });
  const before = plan(PIXELS);
  const after = plan(4 * PIXELS);
  for (let now = 1000; now < 2000; now += INTERVAL) took(pace, before, 1000, now);
  assert.deepEqual([pace.report.moving, pace.report.lastMs], ['whole', null]);
  for (let now = 1000; now < 2000; now += INTERVAL) took(pace, after, 1000, now);
  assert.notEqual(pace.report.moving, 'whole');
  pace.stop();
});

test('levels of detail are built once pictures have moved slowly for 1.5 s, rests not counted', async (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  let now = 5_000;
  context.mock.method(performance, 'now', () => now);
  let builds = 0;
  const detail = new DetailController({
    attributes: { detail: 'auto' },
    services: {
      // Whoever builds asks for it; the scene here cannot be read, and that is said.
      get sceneLoader() {
        builds++;
        return {} as SceneLoader;
      },
    },
    ...{ memoryBudget: undefined, splatsChanged: () => undefined, warn: () => undefined },
  });
  detail.update({ gaussians: { count: 60_000, pages: [] }, detail: {} } as unknown as LoadedGaussians);
  const pass = (milliseconds: number): void => {
    now += milliseconds;
    context.mock.timers.tick(milliseconds);
  };
  const move = async (milliseconds: number, isWhole = false): Promise<number> => {
    for (let spent = 0; spent < milliseconds; spent += 50) {
      pass(50);
      detail.reportMotionFrame(isWhole);
    }
    // They are built by a module of their own.
    await import('../../packages/element/src/detail/build-levels.js');
    await new Promise(setImmediate);
    return builds;
  };
  // A GPU that was idle is slow for a moment, at every gesture.
  for (let gesture = 0; gesture < 4; gesture++) {
    assert.equal(await move(300), 0, `gesture ${gesture}`);
    pass(4_000);
    assert.equal(await move(300, true), 0);
  }
  pass(4_000);
  assert.equal(await move(1_000), 0);
  pass(4_000);
  assert.equal(await move(1_000), 1, 'two seconds of slow pictures in two gestures');
});
