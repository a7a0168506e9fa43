import { GaussianSplatError } from '@gaussian-splat/core';
import { BUFFER_USAGE, perDevice } from '../gpu/kernel.js';
import { canSort, SORT_NAMES, type SortName } from '../stages/sort.js';
import { remember, SAFE, type Variants } from '../variants.js';
import { FrameClock } from './frame-clock.js';
import { keyFor, pageStore, readChoice, writeChoice, type ChoiceStore } from './kept-choice.js';
import { sortsRight, timeSort } from './sort-probe.js';
import { ANSWER_TARGET, FRAMES, isRight, isValid, timeFrames, type Trial } from './trials.js';

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
  { splats: 32_000, width: 960, height: 540 },
  { splats: 256_000, width: 1920, height: 1080 },
];
/** Milliseconds that all rounds may take, and how much longer than the last one the next is expected to be. */
const BUDGET = 800;
const GROWTH = 8;
/** A candidate so much slower than the fastest, in a round that takes as long as is worth measuring, is out. */
const HOPELESS = 1.5;
const MEASURABLE = 1.5;

/** What is likely to suit a GPU. */
const LIKELY: Variants = { rasterizer: 'tiles', accumulation: 'rgba16float', threads: 'parallel', sort: 'shared8' };
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
  // Nothing is compiled for this trial alone.
  const time = await timeFrames(device, LIKELY, ROUNDS[0], clock, ANSWER_TARGET);
  clock.destroy();
  return time;
}

/**
 * Finds the fastest variants that draw the right image on a device, once for each device: those that fail a known answer are out, the
 * others are timed on small scenes. Takes two to five seconds the first time on an adapter, most of them to compile what is not chosen in the end; then the choice is kept in `store`, and
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
  const sort = await chooseSort(device, pause);
  const candidates: Variants[] = [];
  for (const candidate of candidatesFor(device, sort)) {
    await pause();
    if (await isRight(device, candidate)) candidates.push(candidate);
  }
  if (candidates.length > 0) return chooseFastest(device, candidates, pause);
  for (const candidate of lastResorts(sort)) if (await isRight(device, candidate)) return candidate;
  return giveUp(device);
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

/** A way to sort replaces one before it in the list only if it takes less than this share of its time: nobody gains by a choice that flickers. */
const FASTER_SORT = 0.9;
/** Keys that are timed first, on any GPU, and then where they took next to no time: few keys do not tell apart what many do. */
const FEW_KEYS = 2 ** 17;
const MANY_KEYS = 2 ** 21;
/** Milliseconds for few keys up to which many are timed, too. */
const FEW_KEYS_MS = 1;
/** Milliseconds that no GPU takes for few keys. */
const SLOW_SORT_MS = 20;
/** Ways of threads that share a block of keys. */
const SHARED_SORTS = SORT_NAMES.filter((name) => name !== 'serial');
/** Times the fastest that a way to sort may take for few keys to be tried with many. */
const HOPELESS_SORT = 1.5;

/** The fastest way to sort, of those that sort rightly. */
async function chooseSort(device: GPUDevice, pause: Pause): Promise<SortName> {
  // A processor in disguise, by its own account.
  if (device.adapterInfo?.isFallbackAdapter && (await sortsRight(device, 'serial'))) return 'serial';
  const clock = await FrameClock.on(device);
  const trials: SortTrials = { device, pause, clock };
  let times = await timeSorts(trials, await rightSorts(trials, SHARED_SORTS), FEW_KEYS);
  // One that does not say so. What it is best at takes a GPU half a second to compile.
  if (!(Math.min(...times.values()) <= SLOW_SORT_MS))
    for (const [name, time] of await timeSorts(trials, await rightSorts(trials, ['serial']), FEW_KEYS))
      times.set(name, time);
  const least = Math.min(...times.values());
  if (least <= FEW_KEYS_MS) {
    const left = [...times.keys()].filter((name) => times.get(name)! <= HOPELESS_SORT * least);
    times = await timeSorts(trials, left, MANY_KEYS);
  }
  clock.destroy();
  let best = SAFE.sort;
  for (const [name, time] of times) if (time < FASTER_SORT * (times.get(best) ?? Infinity)) best = name;
  return best;
}

interface SortTrials {
  readonly device: GPUDevice;
  readonly pause: Pause;
  readonly clock: FrameClock;
}

async function rightSorts({ device, pause }: SortTrials, names: readonly SortName[]): Promise<SortName[]> {
  const right: SortName[] = [];
  for (const name of names) {
    if (!canSort(device, name)) continue;
    await pause();
    if (await isValid(device, () => sortsRight(device, name))) right.push(name);
  }
  return right;
}

async function timeSorts(
  { device, pause, clock }: SortTrials,
  names: readonly SortName[],
  keys: number,
): Promise<Map<SortName, number>> {
  const times = new Map<SortName, number>();
  for (const name of names) {
    await pause();
    times.set(name, await timeSort(device, name, keys, clock));
  }
  return times;
}

function candidatesFor(device: GPUDevice, sort: SortName): Variants[] {
  const threads = sort === 'serial' ? 'serial' : 'parallel';
  const quads: Variants = { rasterizer: 'quads', accumulation: 'rgba16float', threads, sort };
  const tiles: Variants = { ...quads, rasterizer: 'tiles' };
  const precise: Variants = { ...quads, accumulation: 'rgba32float' };
  const canBlend = device.features.has('float32-blendable');
  // Tiles are made of barriers, which is what a processor in disguise is worst at: ten times slower, and seconds to compile.
  return [quads, ...(canBlend ? [precise] : []), ...(threads === 'parallel' ? [tiles] : [])];
}

/** However slow, if it is right: what was no candidate for its speed, and then the other way to share the work. */
function lastResorts(sort: SortName): Variants[] {
  const variants = (rasterizer: Variants['rasterizer'], sort: SortName): Variants => ({
    rasterizer,
    accumulation: 'rgba16float',
    threads: sort === 'serial' ? 'serial' : 'parallel',
    sort,
  });
  const other = sort === 'serial' ? SAFE.sort : 'serial';
  return [variants('tiles', sort), variants('quads', other), variants('tiles', other)];
}

async function chooseFastest(device: GPUDevice, candidates: readonly Variants[], pause: Pause): Promise<Variants> {
  let left = candidates.map((variants) => ({ variants, time: 0 }));
  let spent = 0;
  const clock = await FrameClock.on(device);
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
  clock.destroy();
  return left[0].variants;
}
