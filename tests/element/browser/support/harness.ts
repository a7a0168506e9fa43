/** Utilities of every browser test: elements, events, images, and checks of the console and the GPU. */
import type { GaussianSplatElement } from '@gaussian-splat/element';

export const FIXTURES = '/tests/element/browser/fixtures/';
/** The scene that most tests show. */
export const COMPASS = `${FIXTURES}compass.splat`;

export function assert(condition: unknown, message: string): asserts condition {
  if (!condition) throw new Error(message);
}

export function assertEqual<T>(actual: T, expected: T, what = 'value'): void {
  const [a, e] = [JSON.stringify(actual), JSON.stringify(expected)];
  assert(a === e, `${what}: expected ${e}, found ${a}`);
}

/** Waits by the page's clock: see {@link hurry}. */
export const delay = (ms: number): Promise<void> => new Promise((resolve) => setTimeout(resolve, ms));

/** The clocks as they were: limits of tests are by these. */
const real = {
  now: performance.now.bind(performance),
  setTimeout: globalThis.setTimeout.bind(globalThis),
  requestAnimationFrame: globalThis.requestAnimationFrame.bind(globalThis),
};
/** The page's time is `shown` when the real one is `since`, and goes `speed` times as fast. It never goes back: what outlives a test has seen it. */
const pageTime = { since: 0, shown: 0, speed: 1 };
const shownAt = (now: number): number => pageTime.shown + pageTime.speed * (now - pageTime.since);

/**
 * Lets the page's clock go faster until the test ends, for tests of delayed events: timers, `performance.now` and the times of frames agree, so that a second of an element takes a fraction of one. Transitions of CSS and requests take as long as ever.
 */
export function hurry(speed: number): void {
  const now = real.now();
  Object.assign(pageTime, { since: now, shown: shownAt(now), speed });
  performance.now = () => shownAt(real.now());
  Object.assign(globalThis, {
    // Tests do not wait for timers of a minute: they limit operations that may hang.
    setTimeout: (callback: () => void, ms = 0) =>
      real.setTimeout(callback, ms < 60_000 ? ms / pageTime.speed : ms * TIMEOUT),
    requestAnimationFrame: (callback: FrameRequestCallback) =>
      real.requestAnimationFrame((time) => callback(shownAt(time))),
  });
}
afterEach(() => {
  if (pageTime.speed !== 1) hurry(1);
});

/** Fulfils two frames later: by then everything that a frame brings about has happened. */
export async function frames(count = 2): Promise<void> {
  for (let i = 0; i < count; i++) await new Promise(requestAnimationFrame);
}

/** A machine that is slow, or busy, takes several times as long: what never comes is found all the same. */
const TIMEOUT = 12;

/** Waits until a condition holds: `limitMs` on a machine that has nothing else to do. */
export async function until(
  condition: () => boolean | Promise<boolean>,
  what: string,
  limitMs = 20_000,
): Promise<void> {
  const end = real.now() + TIMEOUT * limitMs;
  while (!(await condition())) {
    assert(real.now() < end, `waited ${TIMEOUT * limitMs} ms for ${what}`);
    await new Promise((resolve) => real.setTimeout(resolve, 10));
  }
}

/** The next event of a type, or a failure after a while: `limitMs` on a machine that has nothing else to do. */
export function nextEvent<T extends Event>(target: EventTarget, type: string, limitMs = 20_000): Promise<T> {
  return new Promise((resolve, reject) => {
    const max = TIMEOUT * limitMs;
    const timer = real.setTimeout(() => reject(new Error(`no event ${type} within ${max} ms`)), max);
    target.addEventListener(
      type,
      (event) => {
        clearTimeout(timer);
        resolve(event as T);
      },
      { once: true },
    );
  });
}

let gates = 0;

/** A file of the fixtures, in pieces over `ms` milliseconds, whose last part comes when a test releases it: earlier frames are drawn while it loads, on slow machines, too. */
export function gated(file: string, ms = 0): { readonly src: string; open(): Promise<void> } {
  const gate = `${Math.round(performance.timeOrigin)}-${++gates}`;
  return { src: `/net/slow/${file}?ms=${ms}&gate=${gate}`, open: async () => void (await fetch(`/net/open/${gate}`)) };
}

/** An element of 120 x 100 CSS pixels in the page. Every test's elements are removed after it. */
export function show(
  attributes: Readonly<Record<string, string>>,
  style = 'width: 120px; height: 100px',
): GaussianSplatElement {
  const element = document.createElement('gaussian-splat');
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.style.cssText = style;
  document.body.append(element);
  return element;
}

/** The same, once its scene is visible. */
export async function showLoaded(
  attributes: Readonly<Record<string, string>> = {},
  style?: string,
): Promise<GaussianSplatElement> {
  const element = show({ src: COMPASS, ...attributes }, style);
  await element.ready;
  assert(element.loaded, `not loaded: ${element.error?.message ?? 'no error either'}`);
  return element;
}

/**
 * Waits until an element shows its full frame and the page has not drawn for a while, and for a few of its frames: a single frame that says so may still be
 * followed by one of a motion that has just begun, and a machine that stands still for a while has no frames in it.
 */
export async function atRest(element: GaussianSplatElement, quietMs = 400, limitMs = 30_000): Promise<void> {
  let [seen, since, passed, waits] = [submits, performance.now(), 0, true];
  const count = (): void => {
    passed++;
    if (waits) requestAnimationFrame(count);
  };
  requestAnimationFrame(count);
  const isQuiet = (): boolean => {
    const now = performance.now();
    if (submits !== seen || element.stats?.dynamicQuality.drawn !== 'whole') [seen, since, passed] = [submits, now, 0];
    return now - since > quietMs && passed > 4;
  };
  try {
    await until(isQuiet, 'the accurate frame', limitMs);
  } finally {
    waits = false;
  }
  await frames(2);
}

/** All calls of GPUQueue.submit since the page was opened. */
export let submits = 0;
const submit = GPUQueue.prototype.submit;
GPUQueue.prototype.submit = function countingSubmit(this: GPUQueue, commands) {
  submits++;
  return submit.call(this, commands);
};

/** Every device that was handed out, for tests that lose or count them. */
export const devices: GPUDevice[] = [];
const faults: string[] = [];
const requestDevice = GPUAdapter.prototype.requestDevice;
GPUAdapter.prototype.requestDevice = async function watchingRequestDevice(this: GPUAdapter, descriptor) {
  const device = await requestDevice.call(this, descriptor);
  devices.push(device);
  device.addEventListener('uncapturederror', (event) => faults.push(`GPU: ${event.error.message}`));
  return device;
};

/** Errors of elements and their children on the console, which tests expect by the event `error`. */
export const printed: string[] = [];
const OF_ELEMENT = /^<[\w-]+>: .* \[[\w-]+\/[\w-]+\]$/s;

for (const level of ['warn', 'error'] as const) {
  console[level] = (...words: unknown[]) => {
    const text = words.join(' ');
    if (level === 'error' && OF_ELEMENT.test(text)) printed.push(text);
    else faults.push(`console.${level}: ${text}`);
  };
}
addEventListener('error', (event) => faults.push(`uncaught: ${event.message}`));
addEventListener('unhandledrejection', (event) => faults.push(`unhandled: ${String(event.reason)}`));

/** Takes the one fault that matches out of the record; fails if there is not exactly one. */
export function claimFault(pattern: RegExp): void {
  const matches = faults.filter((fault) => pattern.test(fault));
  assertEqual(matches.length, 1, `faults like ${pattern} among ${JSON.stringify(faults)}`);
  faults.splice(faults.indexOf(matches[0]), 1);
}

/** The same for a fault that may be still to come: what says it is fetched first. */
export async function claimComing(pattern: RegExp): Promise<void> {
  await until(() => faults.some((fault) => pattern.test(fault)), `a fault like ${pattern}`);
  claimFault(pattern);
}

/**
 * Warnings of many SPZ files, which name no axes, and of a busy machine, whose worker is late: see meaning.test.ts and loads-apart.alone.lab.test.ts.
 */
const EXPECTED = /does not name its axes|no worker could be started \(none has started within 2 s\)/;

afterEach(() => {
  document.body.replaceChildren();
  printed.length = 0;
  const unclaimed = faults.splice(0).filter((fault) => !EXPECTED.test(fault));
  assert(unclaimed.length === 0, `warnings or errors that no test expected:\n${unclaimed.join('\n')}`);
});
