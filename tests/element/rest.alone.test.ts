/** The time of the full frame once the camera rests: the real controller, with the test's clock and a simulated GPU. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { DetailController, FrameScheduler, type LoadedGaussians } from '../support/element/parts.js';
import {
  DynamicQualityController,
  type FramePlan,
  type DynamicQualityOptions,
  waitForRest,
} from '../support/element/quality.js';
import type { SceneLoader } from '../support/element/loading.js';
import { COSTS, LEVELS } from '../support/pace-gpu.js';

const INTERVAL = 1000 / 60;
const PIXELS = 1e6;
const display = { displayInterval: INTERVAL, clients: 1 } as FrameScheduler;

/** A controller that is on, alone on its display, and uses the display's rate, unless a test says otherwise. */
const qualityOf = (options: Partial<DynamicQualityOptions> = {}): DynamicQualityController =>
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

/** The exact time of a frame that started at a time. */
const took = (
  quality: DynamicQualityController,
  plan: Pick<FramePlan, 'level' | 'size'>,
  milliseconds: number,
  now: number,
): void => quality.sample(plan, { doneAt: now + milliseconds, lowerBound: milliseconds, upperBound: milliseconds });

for (const wholeMs of [20, 100, 200, 214]) {
  test(`an accurate frame of ${wholeMs} ms is visible 300 ms after rest, and not started before 50 ms`, (context) => {
    context.mock.timers.enable({ apis: ['setTimeout'] });
    let asked = false;
    const quality = qualityOf({ requestFrame: () => (asked = true) });
    // A motion that is drawn whole at first, and soon no longer.
    let now = 1000;
    for (let frame = 0; frame < 60; frame++, now += INTERVAL) {
      const plan = quality.plan({ now, pixels: PIXELS, hasChanged: true, goesOn: true });
      const { level } = plan;
      took(quality, plan, level === 0 ? wholeMs : 10, now);
    }
    const plan = quality.plan({ now, pixels: PIXELS, hasChanged: true, goesOn: false });
    const { level } = plan;
    assert.ok(level > 0, 'in motion with less');
    assert.equal(asked, false);
    let waited = 0;
    for (; !asked && waited < 1000; waited++) context.mock.timers.tick(1);
    assert.ok(waited >= 50 && waited <= 150, `begun after ${waited} ms`);
    // The hand stopped up to an interval before its last input was drawn.
    const shown = INTERVAL + waited + INTERVAL + wholeMs;
    assert.ok(shown <= 300, `visible after ${shown} ms`);
    assert.equal(
      quality.plan({ now: now + waited, pixels: PIXELS, hasChanged: false, goesOn: false }).level,
      0,
      'the accurate frame',
    );
    // A hand that continues at once moves as before.
    assert.ok(quality.plan({ now: now + waited + 5, pixels: PIXELS, hasChanged: true, goesOn: true }).level > 0);
    quality.stop();
  });
}

test('accurate frames that cannot be in time start as soon as rest is detected, those of unknown duration as late as possible', () => {
  assert.equal(waitForRest(900, INTERVAL), 50);
  assert.equal(waitForRest(0, INTERVAL), 150);
});

test('the frame budget is that of the page, else a fraction of the display interval that elements divide', () => {
  const scheduler = { displayInterval: INTERVAL, clients: 2 } as FrameScheduler;
  let budget = Infinity;
  const quality = qualityOf({ scheduler: () => scheduler, frameBudget: () => budget });
  assert.equal(quality.targetMs, (0.8 * INTERVAL) / 2);
  for (budget of [2, 40]) {
    assert.equal(quality.targetMs, budget);
    // A frame that the page has room for, and then one that it has not.
    for (const [share, falls] of [
      [0.9, false],
      [5, true],
    ] as const) {
      quality.reset();
      for (let now = 1000; now < 2000; now += INTERVAL) took(quality, { level: 0, size: 0 }, share * budget, now);
      assert.equal(quality.report.moving !== 'whole', falls, `${share} of ${budget} ms`);
    }
  }
});

/** A display that the test drives: one refresh every interval. */
function drivenDisplay(): { now: () => number; present: () => void; restore: () => void } {
  const page = globalThis as unknown as Record<string, unknown>;
  const { requestAnimationFrame, document } = page;
  const waiting: ((now: number) => void)[] = [];
  page.requestAnimationFrame = (draw: (now: number) => void) => waiting.push(draw);
  page.document = { visibilityState: 'visible' };
  let now = 1000;
  return {
    now: () => now,
    present: () => {
      now += INTERVAL;
      for (const draw of waiting.splice(0)) draw(now);
    },
    restore: () => void Object.assign(page, { requestAnimationFrame, document }),
  };
}

test('an element that draws now and then leaves others all but their whole time; two that both move share it within a second, and one alone has it at once', (context) => {
  const { now, present: image, restore } = drivenDisplay();
  context.mock.method(performance, 'now', now);
  const scheduler = new FrameScheduler();
  const ignored = (): void => undefined;
  const quality = qualityOf({ scheduler: () => scheduler });
  const levels: number[] = [];
  // Its frames take 0.7 of the allowed time.
  const moving = {
    drawFrame: (now: number) => {
      const plan = quality.plan({ now, pixels: PIXELS, hasChanged: true, goesOn: true });
      const { level } = plan;
      levels.push(level);
      took(quality, plan, 0.7 * 0.8 * INTERVAL * COSTS[level], now);
    },
  };
  const other = { drawFrame: ignored };
  for (let k = 0; k < 240; k++) {
    scheduler.request(moving);
    if (k % 12 === 0) scheduler.request(other);
    image();
  }
  assert.equal(Math.max(...levels), 0, `levels ${levels.join(' ')}`);
  for (let k = 0; k < 60; k++) {
    scheduler.request(moving);
    scheduler.request(other);
    image();
  }
  assert.ok(Math.abs(quality.targetMs / (0.4 * INTERVAL) - 1) < 0.03, `${quality.targetMs} ms`);
  assert.ok(levels.at(-1)! > 0, 'half of the time is too little for the full frame');
  // A window that is resized draws all of its elements, frame after frame; then one is turned.
  const still = Array.from({ length: 8 }, () => ({ drawFrame: ignored }));
  for (let k = 0; k < 60; k++) {
    for (const each of still) scheduler.request(each);
    image();
  }
  quality.reset();
  levels.length = 0;
  for (let k = 0; k < 30; k++) {
    scheduler.request(moving);
    image();
  }
  assert.equal(Math.max(...levels), 0, `levels ${levels.join(' ')}`);
  quality.stop();
  restore();
});

test('frames that are already small are not made smaller, for any duration', () => {
  const quality = qualityOf();
  const levelOf = (pixels: number): number => {
    for (let now = 1000; now < 3000; now += INTERVAL) {
      const plan = quality.plan({ now, pixels, hasChanged: true, goesOn: true });
      const { level } = plan;
      took(quality, plan, 1000 * COSTS[level], now);
    }
    return quality.plan({ now: 3000, pixels, hasChanged: true, goesOn: true }).level;
  };
  const scaleOf = (level: number): number => LEVELS[level].settings?.resolutionScale ?? 1;
  for (const side of [32, 128, 256, 1024]) {
    quality.reset();
    const scale = scaleOf(levelOf(side ** 2));
    assert.ok(scale === 1 || (scale * side) ** 2 >= 8192, `${scale} of ${side}`);
    assert.equal(scale < 1, side > 100, `${scale} of ${side}`);
  }
  assert.ok(scaleOf(levelOf(1024 ** 2)) < scaleOf(levelOf(128 ** 2)), 'a frame that shrinks resets the chosen level');
});

test('an element of another size is measured again: a small frame that gains nothing from fewer pixels predicts nothing for a large one', () => {
  let now = 1000;
  const quality = qualityOf();
  const move = (seconds: number, pixels: number, takes: (level: number) => number): number => {
    let last = 0;
    for (const end = now + 1000 * seconds; now < end; now += INTERVAL) {
      const plan = quality.plan({ now, pixels, hasChanged: true, goesOn: true });
      const { level } = plan;
      last = takes(level);
      took(quality, plan, last, now);
    }
    return last;
  };
  move(20, 2e5, () => 18);
  assert.equal(quality.plan({ now, pixels: 2e5, hasChanged: true, goesOn: true }).level, 0, 'the small one is whole');
  assert.ok(move(1, 4e6, (level) => 20 * COSTS[level]) <= quality.targetMs, 'the large one is in time within a second');
  // At the lowest level that a small view may have. All levels below are faster.
  move(5, 4e6, (level) => 20 * COSTS[level]);
  move(2, 4e6, (level) => 60 * COSTS[level]);
  const smallMs = [18, 18, 19, 24, 32];
  assert.ok(move(0.5, 17_000, (level) => smallMs[level]) < 32, 'the small one does not wait to be more of itself');
  assert.ok(move(2, 17_000, (level) => smallMs[level]) < 20, 'the small one comes back to what is faster');
  quality.stop();
});

test('an element that becomes smaller in motion shows as many pixels as before at once, not the few that the large one could afford', () => {
  let now = 1000;
  const quality = qualityOf();
  const move = (seconds: number, pixels: number, share: (level: number) => number): number[] => {
    const levels: number[] = [];
    for (const end = now + 1000 * seconds; now < end; now += INTERVAL) {
      const plan = quality.plan({ now, pixels, hasChanged: true, goesOn: true });
      const { level } = plan;
      levels.push(level);
      took(quality, plan, quality.targetMs * share(level), now);
    }
    return levels;
  };
  const [large, small] = [3072 * 1728, 1344 * 756];
  const before = move(3, large, (level) => 8 * COSTS[level]).at(-1)!;
  assert.ok(COSTS[before] <= 1 / 8, LEVELS[before].name);
  // Times of an H200: such a small frame leaves it idle at lower levels, and no level saves enough for a climb.
  const taken = [0.76, 0.72, 0.7, 0.66, 0.62, 0.66, 0.8, 0.9, 0.96, 1.04];
  const [first, ...after] = move(8, small, (level) => taken[level]);
  assert.ok(COSTS[first] * small <= COSTS[before] * large, `${LEVELS[first].name}: more than before`);
  assert.ok(COSTS[first - 1] * small > COSTS[before] * large, `${LEVELS[first].name}: fewer than before`);
  assert.equal(after.at(-1), 0, after.join(' '));
  quality.stop();
});

test('a scene that changes in every other refresh of the display is in motion in those between, and rests as a camera does', (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  const asked: number[] = [];
  let now = 1000;
  const quality = qualityOf({ requestFrame: () => void asked.push(now) });
  const frame = (hasChanged: boolean): number => {
    const plan = quality.plan({ now, pixels: PIXELS, hasChanged, goesOn: false });
    const { level } = plan;
    took(quality, plan, 100 * COSTS[level], now);
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
  assert.deepEqual(asked, [], 'no check for rest between');
  // The last change: later draws do not delay rest.
  for (let waited = 0; asked.length === 0 && waited < 300; waited += INTERVAL) {
    assert.ok(frame(false) > 0, 'not yet at rest');
    context.mock.timers.tick(INTERVAL);
    now += INTERVAL;
  }
  assert.ok(asked.length === 1, 'rest is checked');
  assert.equal(frame(false), 0, 'the accurate frame');
  quality.stop();
});

test('a change during the accurate frame of a pause belongs to the motion before', (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  const quality = qualityOf();
  const plan = (now: number, hasChanged: boolean): FramePlan =>
    quality.plan({ now, pixels: PIXELS, hasChanged, goesOn: false });
  let now = 1000;
  for (let k = 0; k < 30; k++, now += 50) {
    const frame = plan(now, true);
    took(quality, frame, frame.level === 0 ? 300 : 60, now);
  }
  context.mock.timers.tick(200);
  assert.equal(plan(now, false).level, 0, 'the accurate frame is started');
  // It takes 300 ms, and that is not known yet.
  assert.ok(plan(now + 310, true).level > 0, 'the gesture continues');
  quality.stop();
});

test('measurements before the page chose a quality are not reported, and not used afterwards', () => {
  let isOn = true;
  const quality = qualityOf({ isOn: () => isOn });
  const frame = { pixels: PIXELS, hasChanged: true, goesOn: true };
  for (let now = 1000; now < 2000; now += INTERVAL) {
    const plan = quality.plan({ now, ...frame });
    const { level } = plan;
    took(quality, plan, 80 * COSTS[level], now);
  }
  assert.ok(quality.report.moving !== 'whole' && quality.report.lastMs !== null);
  const late = quality.plan({ now: 1990, ...frame });
  isOn = false;
  assert.equal(quality.plan({ now: 2000, ...frame }).level, 0);
  // A frame of before is known only now.
  took(quality, late, 80, 1990);
  const { drawn, moving, reason, frameMs, lastMs } = quality.report;
  assert.deepEqual([drawn, moving, reason, frameMs, lastMs], ['whole', 'whole', 'initial', null, null]);
  quality.stop();
});

test('what a frame took that was drawn in another size says nothing', () => {
  const quality = qualityOf();
  const plan = (pixels: number): FramePlan => quality.plan({ now: 1000, pixels, hasChanged: true, goesOn: true });
  const before = plan(PIXELS);
  const after = plan(4 * PIXELS);
  for (let now = 1000; now < 2000; now += INTERVAL) took(quality, before, 1000, now);
  assert.deepEqual([quality.report.moving, quality.report.lastMs], ['whole', null]);
  for (let now = 1000; now < 2000; now += INTERVAL) took(quality, after, 1000, now);
  assert.notEqual(quality.report.moving, 'whole');
  quality.stop();
});

test('levels of detail are built once frames have moved slowly for 1.5 s, rests not counted', async (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  let now = 5_000;
  context.mock.method(performance, 'now', () => now);
  let builds = 0;
  const detail = new DetailController({
    attributes: { detail: 'auto' },
    services: {
      // The build requests it. The scene here cannot be read, which is reported.
      get sceneLoader() {
        builds++;
        return {} as SceneLoader;
      },
    },
    ...{ memoryBudget: undefined, splatsChanged: () => undefined, owner: { warn: () => undefined } },
  });
  const place = { isLost: false };
  detail.update({
    place,
    gaussians: { count: 60_000, blocks: [] },
    detail: {},
    can: () => true,
  } as unknown as LoadedGaussians);
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
    await import('../../packages/element/src/sources/stream/build-levels.js');
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
  assert.equal(await move(1_000), 1, 'two seconds of slow frames in two gestures');
});
