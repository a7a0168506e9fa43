/** The clock of frames against a simulated page: one thread, a queue with late reports, other work on it; and the controller's conclusions. */
import assert from 'node:assert/strict';
import { test, type TestContext } from 'node:test';
import { QueueClock, type WorkTime } from '@gaussian-splat/renderer/tools';
import { GlClock } from '@gaussian-splat/renderer/webgl';
import { DynamicQualityController } from '../support/element/quality.js';
import type { FrameScheduler } from '../support/element/parts.js';
import { LEVELS } from '../support/pace-gpu.js';

const INTERVAL = 1000 / 60;
/** Milliseconds until the GPU has received submitted work, and until the page learns that it is done. */
const [THERE, BACK] = [0.8, 1.5];

/** A page whose clock advances by its work, and its GPU. */
class Page {
  /** Clocks do not run back. */
  static #started = 0;
  now = (Page.#started += 100_000);
  #free = 0;
  #seen = 0;
  #tasks: { at: number; run: () => void; id: number }[] = [];
  #id = 0;

  constructor(context: TestContext) {
    context.mock.method(performance, 'now', () => this.now);
    context.mock.method(globalThis, 'setTimeout', ((run: () => void, ms = 0) =>
      this.#after(Math.max(1, ms), run)) as never);
    context.mock.method(globalThis, 'clearTimeout', ((id: number) => {
      this.#tasks = this.#tasks.filter((task) => task.id !== id);
    }) as never);
  }

  readonly device = {
    createCommandEncoder: () => ({ finish: () => ({}) }),
    queue: {
      submit: () => this.work(0),
      onSubmittedWorkDone: () =>
        new Promise<void>((resolve) => {
          // The browser answers when it has checked all commands sent to it.
          const answer = (): unknown => (this.#seen + BACK > this.now ? this.#after(1, answer) : resolve());
          this.#after(Math.max(0, this.#free - this.now) + BACK, answer);
        }),
    },
  } as unknown as GPUDevice;

  /** A fence stands behind all that was drawn until then; pages ask whether it was reached. */
  readonly gl = {
    SIGNALED: 1,
    fenceSync: () => this.#free + BACK,
    flush: () => undefined,
    isContextLost: () => false,
    getSyncParameter: (reached: number) => (this.now >= reached ? 1 : 0),
    deleteSync: () => undefined,
  } as unknown as WebGL2RenderingContext;

  /** Submits work of a duration in ms, which the browser validates for a time first. */
  work(milliseconds: number, looks = 0): void {
    this.#seen = Math.max(this.#seen, this.now + THERE) + looks;
    this.#free = Math.max(this.#free, this.#seen) + milliseconds;
  }

  /** The thread is busy. */
  block(milliseconds: number): void {
    this.now += milliseconds;
  }

  /** Runs events that are due until a time. */
  async until(time: number): Promise<void> {
    for (;;) {
      this.#tasks.sort((a, b) => a.at - b.at || a.id - b.id);
      if (!(this.#tasks[0]?.at <= time)) break;
      const { at, run } = this.#tasks.shift()!;
      this.now = Math.max(this.now, at);
      run();
      // Callbacks that wait for it.
      await new Promise(setImmediate);
    }
    this.now = Math.max(this.now, time);
  }

  async clock(): Promise<QueueClock> {
    const clock = QueueClock.of(this.device);
    const calibrated = clock.calibrate();
    await this.until(this.now + 50);
    await calibrated;
    assert.ok(Math.abs(clock.latency - THERE - BACK) < 1e-6, `${clock.latency} ms`);
    return clock;
  }

  #after(milliseconds: number, run: () => void): number {
    this.#tasks.push({ at: this.now + milliseconds, run, id: ++this.#id });
    return this.#id;
  }
}

test("a frame's time is that of its work: alone, behind others, and behind other work on the queue", async (context) => {
  const page = new Page(context);
  const clock = await page.clock();
  const times: WorkTime[] = [];
  const frame = (ms: number): void => void clock.time(() => page.work(ms)).then((time) => void times.push(time));
  frame(0.6);
  await page.until(page.now + 50);
  // Faster than it can do them.
  for (let k = 0; k < 4; k++) {
    frame(40);
    await page.until(page.now + INTERVAL);
  }
  await page.until(page.now + 300);
  // A generator's run.
  clock.isShared = true;
  page.work(30);
  frame(5);
  await page.until(page.now + 100);
  const expected = [0.6, 40, 40, 40, 40, 5];
  assert.equal(times.length, expected.length);
  times.forEach(({ lowerBound, upperBound }, k) => {
    assert.ok(
      Math.abs(lowerBound - expected[k]) < 0.1 && Math.abs(upperBound - expected[k]) < 0.1,
      `${k}: ${lowerBound} ${upperBound}`,
    );
  });
});

test('the clock of WebGL: frames that are drawn before the last is done take what their own work takes', async (context) => {
  const page = new Page(context);
  const clock = new GlClock(page.gl);
  const times: WorkTime[] = [];
  const expected = [20, 40, 40, 40, 40, 10];
  for (const ms of expected) {
    void clock.time(() => page.work(ms)).then((time) => void times.push(time));
    await page.until(page.now + INTERVAL);
  }
  await page.until(page.now + 300);
  assert.equal(times.length, expected.length);
  times.forEach(({ lowerBound, upperBound }, k) => {
    // The time of waiting for no work is not subtracted, and pages ask once a millisecond.
    const [min, max] = [expected[k] - 2, expected[k] + THERE + BACK + 2];
    assert.ok(lowerBound >= min && upperBound <= max, `${k}: ${lowerBound} to ${upperBound}, not ${expected[k]} ms`);
  });
});

test('a frame that is reported late, because the thread was busy, took a time between its minimum and its measured one', async (context) => {
  const page = new Page(context);
  const clock = await page.clock();
  for (const work of [0.6, 8, 25, 60]) {
    for (const [before, blocked] of [
      [0, 40],
      [5, 30],
    ]) {
      let found: WorkTime | undefined;
      void clock.time(() => page.work(work)).then((time) => (found = time));
      await page.until(page.now + before);
      page.block(blocked);
      await page.until(page.now + 200);
      const { lowerBound, upperBound } = found!;
      assert.ok(lowerBound <= work + 0.1 && upperBound >= work - 0.1, `${work} ms: ${lowerBound} to ${upperBound}`);
      const done = work + THERE + BACK;
      const isLate = done > before && done < before + blocked;
      assert.equal(
        upperBound - lowerBound > 2,
        isLate,
        `${work} ms, busy from ${before} on: ${lowerBound} to ${upperBound}`,
      );
    }
  }
});

/** Turns for three seconds. @returns the level at the end */
async function turn(page: Page, work: number, looks = 0, onFrame: () => void = () => undefined): Promise<string> {
  const clock = await page.clock();
  const quality = new DynamicQualityController({
    isOn: () => true,
    scheduler: () => ({ displayInterval: INTERVAL, clients: 1 }) as FrameScheduler,
    frameBudget: () => Infinity,
    requestFrame: () => undefined,
    mayFade: () => true,
    onFrameTimed: () => undefined,
    levels: LEVELS,
  });
  let flying = 0;
  for (const end = page.now + 3_000; page.now < end;) {
    const next = page.now + INTERVAL;
    // As browsers do, no more than two.
    if (flying < 2) {
      const plan = quality.plan({ now: page.now, pixels: 2e6, hasChanged: true, goesOn: true });
      flying++;
      void clock
        .time(() => {
          const share = (plan.settings?.resolutionScale ?? 1) ** 2;
          page.work(work * share, looks * share);
        })
        .then((time) => {
          flying--;
          quality.sample(plan, time);
        });
      onFrame();
    }
    await page.until(next);
  }
  await page.until(page.now + 1_000);
  quality.stop();
  return quality.report.moving;
}

test('a GPU that works for 1 ms and whose frames take 20, since the browser looks at them for long, is drawn with less', async (context) => {
  assert.notEqual(await turn(new Page(context), 1, 19), 'whole');
  assert.notEqual(await turn(new Page(context), 20), 'whole');
});

test('a page that is busy for 30 ms in every frame is no slow GPU', async (context) => {
  const page = new Page(context);
  assert.equal(await turn(page, 0.6, 0, () => page.block(30)), 'whole');
});

test('errors of what is timed are thrown at once, not kept by the promise of the time', (context) => {
  const page = new Page(context);
  const fail = (): never => {
    throw new Error('no buffer');
  };
  assert.throws(() => QueueClock.of(page.device).time(fail), /no buffer/);
  assert.throws(() => new GlClock(page.gl).time(fail), /no buffer/);
});
