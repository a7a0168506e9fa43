import { loadModule, type GaussianSplatError } from '@gaussian-splat/core';
import { BUFFER_USAGE, perDevice } from '../gpu/kernel.js';
import { PREFERRED, setVariants, FALLBACK, type Variants } from '../variants.js';
import { keyFor, pageStore, readStored, writeStored, type AutotuneStore } from './store.js';
import type * as trials from './timing.js';

export interface AutotuneOptions {
  /** Storage of results. Default: the `localStorage` of the page, if it is available. Null for no storage. */
  readonly store?: AutotuneStore | null;
  /** Function that is awaited before each step, for pages that have more urgent work. */
  readonly pause?: () => Promise<void>;
  /** Format of the targets of later frames, whose pipelines are compiled concurrently. */
  readonly format?: GPUTextureFormat;
}

export interface StartOptions extends AutotuneOptions {
  /** Maximum milliseconds of a small frame with the preferred variants; slower ones are not accepted. Default: 8. */
  readonly maxFrameMs?: number;
}

/**
 * Autotuning of one device, which is running or finished: the choice for the first frame, and the result of {@link
 * autotune}.
 */
interface Choice {
  started?: Promise<Variants>;
  chosen?: Promise<Variants>;
}

const choiceOf = (device: GPUDevice): Choice => perDevice(device, 'choice', () => ({}));

/** `GPUMapMode.READ` as a number, because Node defines this global only if Dawn is loaded. */
const MAP_READ = 1;

const QUICK_MS = 8;

/** Name of the code that is loaded late, for error messages. */
const SELF_TEST = 'the GPU self-test';

/** Loads the self-test, while the bytes of a scene are in transit. */
const loadTiming = (): Promise<typeof trials> => loadModule(SELF_TEST, () => import('./timing.js'));

/** Prepares {@link pickInitialVariants} while a page waits for its device: loads its code, and computes the expected image. */
export function prepareInitialVariants(): void {
  // A failure is reported when the code is used.
  loadTiming().then(
    ({ expectedImage }) => expectedImage(),
    () => undefined,
  );
}

/**
 * Selects variants for an early first frame, once for each device. The stored variants of an earlier visit come first.
 * Without them, the variants that most GPUs prefer are selected if they pass the self-test and are fast enough.
 * Otherwise {@link autotune} selects them, which takes seconds. A page that got the preferred variants may autotune
 * later, at rest.
 * @throws GaussianSplatError as {@link autotune} does.
 */
export function pickInitialVariants(device: GPUDevice, options: StartOptions = {}): Promise<Variants> {
  return once(device, 'started', (choice) => choice.chosen ?? start(device, options, choice));
}

/** Makes a choice once for each device. A choice whose code could not be loaded is forgotten, and made again later. */
function once(device: GPUDevice, name: keyof Choice, make: (choice: Choice) => Promise<Variants>): Promise<Variants> {
  const choice = choiceOf(device);
  return (choice[name] ??= make(choice).catch((error: unknown) => {
    if ((error as Partial<GaussianSplatError>).code === 'network/unreachable') choice[name] = undefined;
    throw error;
  }));
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
 * Finds the fastest variants that draw the correct image on a device, once for each device. Variants that fail the
 * self-test are excluded; the others are timed on small scenes. Viewpoints created afterwards use the result for `auto`
 * settings. Earlier viewpoints use the stored result of a previous visit, or else `quads`, `rgba16float` and
 * `parallel`, which work on every device. The first call on an adapter takes about a second, most of it to compile
 * variants that are not chosen. The result is then kept in `store`, and later visits only repeat its self-test. The
 * performance timeline contains the duration as `gaussian-splat.search`, with the milliseconds of pauses as
 * `detail.paused`.
 * @throws GaussianSplatError `unsupported/wrong-image` if no variant passes the self-test.
 */
export function autotune(device: GPUDevice, options: AutotuneOptions = {}): Promise<Variants> {
  return once(device, 'chosen', () => choose(device, options));
}

async function choose(device: GPUDevice, options: AutotuneOptions): Promise<Variants> {
  const { store = pageStore(), pause = async () => undefined, format } = options;
  const kept = readStored(store, device);
  const variants =
    kept !== undefined && (await (await loadTiming()).passes(device, kept, format))
      ? kept
      : await search(device, pause);
  // Results of a lost device say nothing about its adapter, so they are not stored.
  if (!(await isAlive(device))) return FALLBACK;
  setVariants(device, variants);
  writeStored(store, keyFor(device), variants);
  return variants;
}

/** Runs the search, whose code is loaded on demand, because most visits find a stored result. */
async function search(device: GPUDevice, pause: () => Promise<void>): Promise<Variants> {
  const detail = { paused: 0 };
  const timedPause = async (): Promise<void> => {
    const begin = performance.now();
    await pause();
    detail.paused += performance.now() - begin;
  };
  const find = async (): Promise<Variants> => {
    const { searchVariants, wrongImage } = await loadModule(SELF_TEST, () => import('./search.js'));
    const found = await searchVariants(device, timedPause);
    if (found) return found;
    // A wrong image is worse than no image. A lost device draws nothing, and its loss is reported elsewhere.
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

/** Whether a device still works. A lost device never works again. */
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
