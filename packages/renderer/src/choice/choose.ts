import { GaussianSplatError } from '@gaussian-splat/core';
import { BUFFER_USAGE, perDevice } from '../gpu/kernel.js';
import { remember, SAFE, type Variants } from '../variants.js';
import { FrameClock } from './frame-clock.js';
import { keyFor, pageStore, readChoice, writeChoice, type ChoiceStore } from './kept-choice.js';
import { ANSWER_TARGET, FRAMES, isRight, timeFrames, type Trial } from './trials.js';

export interface ChoiceOptions {
  /** Default: the page's `localStorage` where there is one. null: nothing is kept. */
  readonly store?: ChoiceStore | null;
  /** Awaited before each piece of the work, for pages that have something better to do at times. */
  readonly pause?: () => Promise<void>;
  /** Of the pictures to come: what they need is made at the same time. */
  readonly format?: GPUTextureFormat;
}

export interface StartOptions extends ChoiceOptions {
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

/** Scenes of the trials: until one candidate is left, or the time is up. */
const ROUNDS: readonly Trial[] = [
  { splats: 4_000, width: 320, height: 180 },
  { splats: 64_000, width: 1920, height: 1080 },
];
/** Milliseconds that all rounds may take, and how much longer than the last one the next is expected to be. */
const BUDGET = 800;
const GROWTH = 16;
/** A candidate so much slower than the fastest, in a round that takes as long as is worth measuring, is out. */
const HOPELESS = 1.5;
const MEASURABLE = 1.5;

/** What is likely to suit a GPU. */
const LIKELY: Variants = { rasterizer: 'tiles', accumulation: 'rgba16float', threads: 'parallel' };
/** What suits a processor in disguise: tiles are made of barriers, which it is worst at. Of float32 quads it has to convert nothing. */
const SERIAL: Variants = { ...SAFE, threads: 'serial' };
const PRECISE: Variants = { ...SERIAL, accumulation: 'rgba32float' };
/** Milliseconds of the smallest trial that no GPU takes. */
const NO_GPU_MS = 60;
const QUICK_MS = 8;

/**
 * Finds variants with which a first picture can be drawn soon, once for each device: those that an earlier visit chose; else what is likely to suit a
 * GPU, if it gives the known answer and is quick enough; else what {@link chooseVariants} takes seconds to find, which a page with a likely one
 * may ask for later, when it is at rest.
 * @throws GaussianSplatError as {@link chooseVariants}
 */
export function startVariants(device: GPUDevice, options: StartOptions = {}): Promise<Variants> {
  const choice = choiceOf(device);
  return (choice.started ??= choice.chosen ?? start(device, options, choice));
}

async function start(device: GPUDevice, options: StartOptions, choice: Choice): Promise<Variants> {
  const { store = pageStore(), quickMs = QUICK_MS, format } = options;
  const isOpen = !device.adapterInfo?.isFallbackAdapter && readChoice(store, device) === undefined;
  if (!isOpen || !(await isRight(device, LIKELY, format)) || !((await likelyMs(device)) <= quickMs))
    return chooseVariants(device, options);
  if (!choice.chosen) remember(device, LIKELY);
  return LIKELY;
}

async function likelyMs(device: GPUDevice): Promise<number> {
  const clock = await FrameClock.on(device);
  // Into what the known answer was drawn into: nothing is compiled for this trial alone.
  return timeFrames(device, LIKELY, ROUNDS[0], clock, ANSWER_TARGET);
}

/**
 * Finds the fastest variants that draw the right image on a device, once for each device: those that fail a known answer are out, the
 * others are timed on small scenes. Takes about a second the first time on an adapter, most of it to compile what is not chosen in the end; then the choice is kept in `store`, and
 * only its answer is checked again.
 * @throws GaussianSplatError `unsupported/wrong-image` if no variant gives the known answer.
 */
export function chooseVariants(device: GPUDevice, options: ChoiceOptions = {}): Promise<Variants> {
  return (choiceOf(device).chosen ??= choose(device, options));
}

async function choose(device: GPUDevice, options: ChoiceOptions): Promise<Variants> {
  const { store = pageStore(), pause = noPause, format } = options;
  const kept = readChoice(store, device);
  const variants = kept !== undefined && (await isRight(device, kept, format)) ? kept : await probe(device, pause);
  // What a device answered while it was lost says nothing about the adapter, whose other devices would go by it.
  if (!(await isAlive(device))) return SAFE;
  remember(device, variants);
  writeChoice(store, keyFor(device), variants);
  return variants;
}

async function noPause(): Promise<void> {
  // Nothing else is to be done.
}

type Pause = () => Promise<void>;

async function probe(device: GPUDevice, pause: Pause): Promise<Variants> {
  const processors = device.features.has('float32-blendable') ? [SERIAL, PRECISE] : [SERIAL];
  const likely = device.adapterInfo?.isFallbackAdapter ? processors : [LIKELY, SAFE];
  const candidates = await rightOf(device, likely, pause);
  const clock = await FrameClock.on(device);
  // A processor that does not say that it is one.
  if (likely !== processors && !(await isQuick(device, candidates, clock)))
    candidates.push(...(await rightOf(device, processors, pause)));
  if (candidates.length > 0) return chooseFastest(device, candidates, clock, pause);
  for (const candidate of LAST_RESORTS) if (await isRight(device, candidate)) return candidate;
  return giveUp(device);
}

/** However slow, if they are right: what was no candidate for its speed. */
const LAST_RESORTS: readonly Variants[] = [LIKELY, SAFE, SERIAL, { ...LIKELY, threads: 'serial' }];

async function rightOf(device: GPUDevice, candidates: readonly Variants[], pause: Pause): Promise<Variants[]> {
  const right: Variants[] = [];
  for (const candidate of candidates) {
    await pause();
    if (await isRight(device, candidate)) right.push(candidate);
  }
  return right;
}

async function isQuick(device: GPUDevice, [first]: readonly Variants[], clock: FrameClock): Promise<boolean> {
  return first !== undefined && (await timeFrames(device, first, ROUNDS[0], clock)) < NO_GPU_MS;
}

/** A wrong picture is worse than none. A lost device draws none, and says so itself. */
async function giveUp(device: GPUDevice): Promise<Variants> {
  if (!(await isAlive(device))) return SAFE;
  const { vendor = '', architecture = '', description = '' } = device.adapterInfo ?? {};
  throw new GaussianSplatError('unsupported/wrong-image', {
    where: `the graphics adapter ${[vendor, architecture, description].filter(Boolean).join(' ') || '(unnamed)'}`,
    expected: 'the known picture of 64 spheres',
    found: 'another picture from every variant of the renderer',
    remedy: 'update the browser and the graphics driver, and report it with this message',
  });
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

async function chooseFastest(
  device: GPUDevice,
  candidates: readonly Variants[],
  clock: FrameClock,
  pause: Pause,
): Promise<Variants> {
  let left = candidates.map((variants) => ({ variants, time: 0 }));
  let spent = 0;
  for (const round of ROUNDS) {
    // Only what the GPU did counts: pipelines that had to be made first are of use later.
    const last = FRAMES * left.reduce((sum, { time }) => sum + time, 0);
    if (left.length === 1 || spent + GROWTH * last > BUDGET) break;
    for (const candidate of left) {
      await pause();
      candidate.time = await timeFrames(device, candidate.variants, round, clock);
    }
    spent += FRAMES * left.reduce((sum, { time }) => sum + time, 0);
    left.sort((a, b) => a.time - b.time);
    const best = left[0].time;
    left = left.filter(({ time }) => best < MEASURABLE || time <= HOPELESS * best);
  }
  return left[0].variants;
}
