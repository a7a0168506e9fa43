import { loadModule } from '@gaussian-splat/core';
import { BUFFER_USAGE, perDevice } from '../gpu/kernel.js';
import { LIKELY, remember, SAFE, type Variants } from '../variants.js';
import { keyFor, pageStore, readChoice, writeChoice, type AutotuneStore } from './kept-choice.js';
import type * as trials from './trials.js';

export interface AutotuneOptions {
  /** Default: the page's `localStorage` where there is one. null: nothing is kept. */
  readonly store?: AutotuneStore | null;
  /** Awaited before each piece of the work, for pages that have something better to do at times. */
  readonly pause?: () => Promise<void>;
  /** Of the frames to come: what they need is made at the same time. */
  readonly format?: GPUTextureFormat;
}

export interface StartOptions extends AutotuneOptions {
  /** Milliseconds that a small frame of what is likely to suit a GPU may take there; default 8. */
  readonly quickMs?: number;
}

/** What is under way for a device, or done. */
interface Choice {
  started?: Promise<Variants>;
  chosen?: Promise<Variants>;
}

const choiceOf = (device: GPUDevice): Choice => perDevice(device, 'choice', () => ({}));

/** GPUMapMode.READ, which Node has only where Dawn was loaded. */
const MAP_READ = 1;

const QUICK_MS = 8;

/** The self-test, which comes while the bytes of a scene are on their way. */
const loadTrials = (): Promise<typeof trials> => loadModule('the self-test of the GPU', () => import('./trials.js'));

/**
 * Finds variants with which a first frame can be drawn soon, once for each device: those that an earlier visit chose; else what is likely to suit a
 * GPU, if it passes the self-test and is quick enough; else what {@link autotune} takes seconds to find, which a page with a likely one
 * may ask for later, when it is at rest.
 * @throws GaussianSplatError as {@link autotune}
 */
export function startVariants(device: GPUDevice, options: StartOptions = {}): Promise<Variants> {
  const choice = choiceOf(device);
  return (choice.started ??= choice.chosen ?? start(device, options, choice));
}

async function start(device: GPUDevice, options: StartOptions, choice: Choice): Promise<Variants> {
  const { store = pageStore(), quickMs = QUICK_MS, format } = options;
  const isOpen = !device.adapterInfo?.isFallbackAdapter && readChoice(store, device) === undefined;
  const isGood =
    isOpen && (await measured('start', async () => (await loadTrials()).isGoodStart(device, LIKELY, quickMs, format)));
  if (!isGood) return autotune(device, options);
  if (!choice.chosen) remember(device, LIKELY);
  return LIKELY;
}

/**
 * Finds the fastest variants that draw the right image on a device, once for each device: those that fail a self-test are out, the
 * others are timed on small scenes. Viewpoints made after that draw their `auto` settings with them; before, with what was chosen on the device on an earlier visit, or else `quads`,
 * `rgba16float` and `parallel`, which work everywhere. Takes about a second the first time on an adapter, most of it to compile what is not chosen in the end; then the choice is kept in `store`, and
 * only its answer is checked again. What it took is in the performance timeline, as `gaussian-splat.search`; of that, `detail.paused` milliseconds were pauses.
 * @throws GaussianSplatError `unsupported/wrong-image` if no variant passes the self-test.
 */
export function autotune(device: GPUDevice, options: AutotuneOptions = {}): Promise<Variants> {
  return (choiceOf(device).chosen ??= choose(device, options));
}

async function choose(device: GPUDevice, options: AutotuneOptions): Promise<Variants> {
  const { store = pageStore(), pause = noPause, format } = options;
  const kept = readChoice(store, device);
  const variants =
    kept !== undefined && (await (await loadTrials()).isRight(device, kept, format))
      ? kept
      : await search(device, pause);
  // What a device answered while it was lost says nothing about the adapter, whose other devices would go by it.
  if (!(await isAlive(device))) return SAFE;
  remember(device, variants);
  writeChoice(store, keyFor(device), variants);
  return variants;
}

async function noPause(): Promise<void> {
  // Nothing else is to be done.
}

/** Loaded when it runs: most visits know what suits their device. */
async function search(device: GPUDevice, pause: () => Promise<void>): Promise<Variants> {
  const detail = { paused: 0 };
  const timedPause = async (): Promise<void> => {
    const begin = performance.now();
    await pause();
    detail.paused += performance.now() - begin;
  };
  const find = async (): Promise<Variants> => {
    const { searchVariants, wrongImage } = await loadModule(
      'the code that tries variants',
      () => import('./search.js'),
    );
    const found = await searchVariants(device, timedPause);
    if (found) return found;
    // A wrong picture is worse than none. A lost device draws none, and says so itself.
    if (!(await isAlive(device))) return SAFE;
    throw wrongImage(device);
  };
  return measured('search', find, detail);
}

/** Notes in the performance timeline, as `gaussian-splat.NAME`, what a part of the choice took. */
async function measured<T>(name: string, work: () => Promise<T>, detail?: object): Promise<T> {
  const start = performance.now();
  try {
    return await work();
  } finally {
    performance.measure(`gaussian-splat.${name}`, { start, detail });
  }
}

/** Whether a device still answers, and so did before: one that is lost stays lost. */
async function isAlive(device: GPUDevice): Promise<boolean> {
  const buffer = device.createBuffer({ label: 'gs.probe.alive', size: 4, usage: BUFFER_USAGE.mapRead });
  try {
    await buffer.mapAsync(MAP_READ);
    return true;
  } catch {
    return false;
  } finally {
    buffer.destroy();
  }
}
