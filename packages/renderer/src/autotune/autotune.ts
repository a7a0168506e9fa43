import { loadModule } from '@gaussian-splat/core';
import { BUFFER_USAGE, perDevice } from '../gpu/kernel.js';
import { PREFERRED, setVariants, FALLBACK, type Variants } from '../variants.js';
import { keyFor, pageStore, readStored, writeStored, type AutotuneStore } from './store.js';
import type * as trials from './timing.js';

export interface AutotuneOptions {
  /** Default: the `localStorage` of the page, if it has one. null: no storage. */
  readonly store?: AutotuneStore | null;
  /** Awaited before each step of the work, for pages that have more urgent work. */
  readonly pause?: () => Promise<void>;
  /** Format of the frames to come: their pipelines are compiled at the same time. */
  readonly format?: GPUTextureFormat;
}

export interface StartOptions extends AutotuneOptions {
  /** Upper limit in milliseconds of a small frame with the preferred variants; default 8. */
  readonly maxFrameMs?: number;
}

/** Autotuning of one device, running or finished. */
interface Choice {
  started?: Promise<Variants>;
  chosen?: Promise<Variants>;
}

const choiceOf = (device: GPUDevice): Choice => perDevice(device, 'choice', () => ({}));

/** GPUMapMode.READ, which Node defines only if Dawn is loaded. */
const MAP_READ = 1;

const QUICK_MS = 8;

/** The self-test, loaded while the bytes of a scene are in transit. */
const loadTiming = (): Promise<typeof trials> => loadModule('the self-test of the GPU', () => import('./timing.js'));

/**
 * Finds variants for an early first frame, once for each device: the stored ones of an earlier visit; else the variants
 * that most GPUs prefer, if they pass the self-test and are fast enough; else the result of {@link autotune}, which
 * takes seconds. A page that got preferred variants may autotune later, at rest.
 * @throws GaussianSplatError as {@link autotune}
 */
export function pickInitialVariants(device: GPUDevice, options: StartOptions = {}): Promise<Variants> {
  const choice = choiceOf(device);
  return (choice.started ??= choice.chosen ?? start(device, options, choice));
}

async function start(device: GPUDevice, options: StartOptions, choice: Choice): Promise<Variants> {
  const { store = pageStore(), maxFrameMs = QUICK_MS, format } = options;
  const isOpen = !device.adapterInfo?.isFallbackAdapter && readStored(store, device) === undefined;
  const isGood =
    isOpen &&
    (await measured('start', async () => (await loadTiming()).isGoodStart(device, PREFERRED, maxFrameMs, format)));
  if (!isGood) return autotune(device, options);
  if (!choice.chosen) setVariants(device, PREFERRED);
  return PREFERRED;
}

/**
 * Finds the fastest variants that draw the right image on a device, once for each device: variants that fail the
 * self-test are excluded, the others are timed on small scenes. Viewpoints created afterwards use the result for `auto`
 * settings; earlier ones use the stored result of a previous visit, or else `quads`, `rgba16float` and `parallel`,
 * which work everywhere. Takes about a second the first time on an adapter, most of it to compile variants that are not
 * chosen; then the result is kept in `store`, and only its self-test is repeated. The duration is in the performance
 * timeline as `gaussian-splat.search`, of it `detail.paused` milliseconds of pauses.
 * @throws GaussianSplatError `unsupported/wrong-image` if no variant passes the self-test.
 */
export function autotune(device: GPUDevice, options: AutotuneOptions = {}): Promise<Variants> {
  return (choiceOf(device).chosen ??= choose(device, options));
}

async function choose(device: GPUDevice, options: AutotuneOptions): Promise<Variants> {
  const { store = pageStore(), pause = noPause, format } = options;
  const kept = readStored(store, device);
  const variants =
    kept !== undefined && (await (await loadTiming()).passes(device, kept, format))
      ? kept
      : await search(device, pause);
  // Results of a lost device say nothing about the adapter, so they are not stored for its other devices.
  if (!(await isAlive(device))) return FALLBACK;
  setVariants(device, variants);
  writeStored(store, keyFor(device), variants);
  return variants;
}

async function noPause(): Promise<void> {
  // A failed compilation needs no handling here.
}

/** Loaded on demand, because most visits find a stored result. */
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
    // A wrong image is worse than none. A lost device draws none, and reports its own error.
    if (!(await isAlive(device))) return FALLBACK;
    throw wrongImage(device);
  };
  return measured('search', find, detail);
}

/** Records the duration of a step in the performance timeline, as `gaussian-splat.NAME`. */
async function measured<T>(name: string, work: () => Promise<T>, detail?: object): Promise<T> {
  const start = performance.now();
  try {
    return await work();
  } finally {
    performance.measure(`gaussian-splat.${name}`, { start, detail });
  }
}

/** Whether a device still works: a lost one stays lost. */
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
