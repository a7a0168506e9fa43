import { GaussianSplatError } from '@gaussian-splat/core';
import { GaussianBuffers } from '../gaussian-buffers.js';
import { FrameClock } from './frame-clock.js';
import { BUFFER_USAGE, perDevice, TEXTURE_USAGE } from '../gpu/kernel.js';
import { Renderer } from '../renderer.js';
import { remember, SAFE, type Variants } from '../variants.js';
import { givesKnownAnswer, packSpheres, probeCamera, sphereCloud } from './known-answer.js';
import { canSort, SORT_NAMES, type SortName } from '../stages/sort.js';
import { sortsRight, timeSort } from './sort-probe.js';

/** Where a choice is kept between visits: `localStorage`, or anything like it. */
export interface ChoiceStore {
  getItem(key: string): string | null;
  setItem(key: string, value: string): void;
}

export interface ChoiceOptions {
  /** Default: the page's `localStorage` where there is one. null: nothing is kept. */
  readonly store?: ChoiceStore | null;
}

/** GPUMapMode.READ, which Node has only where Dawn was loaded. */
const MAP_READ = 1;

/** Changes whenever a variant does, so that old choices are made anew. */
const VERSION = 3;

/** Scenes of the probe: until one candidate is left, or the time is up. */
const ROUNDS = [
  { splats: 4_000, width: 320, height: 180 },
  { splats: 32_000, width: 960, height: 540 },
  { splats: 256_000, width: 1920, height: 1080 },
];
/** Milliseconds that all rounds may take, and how much longer than the last one the next is expected to be. */
const BUDGET = 800;
const GROWTH = 8;
const FRAMES = 4;
/** A candidate so much slower than the fastest, in a round that takes as long as is worth measuring, is out. */
const HOPELESS = 1.5;
const MEASURABLE = 1.5;

/**
 * Finds the fastest variants that draw the right image on a device, once for each device: those that fail a known answer are out, the
 * others are timed on small scenes. Takes a few tenths of a second the first time on an adapter; then the choice is kept in `store`, and
 * only its answer is checked again.
 * @throws GaussianSplatError `unsupported/wrong-image` if no variant gives the known answer.
 */
export function chooseVariants(device: GPUDevice, options: ChoiceOptions = {}): Promise<Variants> {
  return perDevice(device, 'choice', async () => {
    const store = options.store === undefined ? pageStore() : options.store;
    const kept = readChoice(store, device);
    const variants = kept !== undefined && (await isRight(device, kept)) ? kept : await probe(device);
    // What a device answered while it was lost says nothing about the adapter, whose other devices would go by it.
    if (!(await isAlive(device))) return SAFE;
    remember(device, variants);
    writeChoice(store, keyFor(device), variants);
    return variants;
  });
}

async function probe(device: GPUDevice): Promise<Variants> {
  const sort = await chooseSort(device);
  const candidates: Variants[] = [];
  for (const candidate of candidatesFor(device, sort)) {
    if (await isRight(device, candidate)) candidates.push(candidate);
  }
  if (candidates.length > 0) return chooseFastest(device, candidates);
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
/** Times the fastest that a way to sort may take for few keys to be tried with many. */
const HOPELESS_SORT = 1.5;

/** The fastest way to sort, of those that sort rightly. */
async function chooseSort(device: GPUDevice): Promise<SortName> {
  // A processor in disguise, by its own account.
  if (device.adapterInfo?.isFallbackAdapter && (await sortsRight(device, 'serial'))) return 'serial';
  const right: SortName[] = [];
  for (const name of SORT_NAMES) {
    if (canSort(device, name) && (await isValid(device, () => sortsRight(device, name)))) right.push(name);
  }
  const clock = await FrameClock.on(device);
  let times = await timeSorts(device, right, FEW_KEYS, clock);
  const least = Math.min(...times.values());
  if (least <= FEW_KEYS_MS) {
    const left = right.filter((name) => times.get(name)! <= HOPELESS_SORT * least);
    times = await timeSorts(device, left, MANY_KEYS, clock);
  }
  clock.destroy();
  let best = SAFE.sort;
  for (const [name, time] of times) if (time < FASTER_SORT * (times.get(best) ?? Infinity)) best = name;
  return best;
}

async function timeSorts(
  device: GPUDevice,
  names: readonly SortName[],
  keys: number,
  clock: FrameClock,
): Promise<Map<SortName, number>> {
  const times = new Map<SortName, number>();
  for (const name of names) times.set(name, await timeSort(device, name, keys, clock));
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

const isRight = (device: GPUDevice, variants: Variants): Promise<boolean> =>
  isValid(device, () => givesKnownAnswer(device, variants));

/** Whether an answer is right, and WebGPU had nothing to say against the way to it. */
async function isValid(device: GPUDevice, answer: () => Promise<boolean>): Promise<boolean> {
  device.pushErrorScope('validation');
  const isAnswer = await answer().catch(() => false);
  return (await device.popErrorScope().catch(() => undefined)) === null && isAnswer;
}

async function chooseFastest(device: GPUDevice, candidates: readonly Variants[]): Promise<Variants> {
  let left = candidates.map((variants) => ({ variants, time: 0 }));
  let spent = 0;
  const clock = await FrameClock.on(device);
  for (const round of ROUNDS) {
    // Only what the GPU did counts: pipelines that had to be made first are of use later.
    const last = FRAMES * left.reduce((sum, { time }) => sum + time, 0);
    if (left.length === 1 || spent + GROWTH * last > BUDGET) break;
    for (const candidate of left) candidate.time = await timeFrames(device, candidate.variants, round, clock);
    spent += FRAMES * left.reduce((sum, { time }) => sum + time, 0);
    left.sort((a, b) => a.time - b.time);
    const best = left[0].time;
    left = left.filter(({ time }) => best < MEASURABLE || time <= HOPELESS * best);
  }
  clock.destroy();
  return left[0].variants;
}

/** Milliseconds of the fastest of a few frames of a turning camera. */
async function timeFrames(
  device: GPUDevice,
  variants: Variants,
  { splats, width, height }: (typeof ROUNDS)[number],
  clock: FrameClock,
): Promise<number> {
  const size = Math.cbrt(400 / splats);
  const gaussians = await GaussianBuffers.upload(device, packSpheres(sphereCloud(splats, size), 'int8'));
  const renderer = new Renderer(device, variants);
  const usage = TEXTURE_USAGE.renderAttachment | TEXTURE_USAGE.storageBinding;
  const target = device.createTexture({ label: 'gs.probe', size: [width, height], format: 'rgba8unorm', usage });
  const camera = probeCamera(width, height);
  let best = Infinity;
  for (let frame = 0; frame < FRAMES; frame++) {
    const time = await clock.time((timer) => renderer.render({ gaussians, camera, target, timer }));
    // The first frame also makes pipelines and orders everything.
    if (frame > 0) best = Math.min(best, time);
  }
  target.destroy();
  renderer.destroy();
  gaussians.destroy();
  return best;
}

function keyFor(device: GPUDevice): string {
  const { vendor = '', architecture = '', device: model = '', description = '' } = device.adapterInfo ?? {};
  const features = [...device.features].sort().join(' ');
  return `gaussian-splat ${VERSION} ${[vendor, architecture, model, description].join(' ')} ${features}`;
}

function pageStore(): ChoiceStore | null {
  try {
    return (globalThis as { localStorage?: ChoiceStore }).localStorage ?? null;
  } catch {
    // A page may be denied its storage.
    return null;
  }
}

function readChoice(store: ChoiceStore | null, device: GPUDevice): Variants | undefined {
  try {
    const { rasterizer, accumulation, threads, sort } = JSON.parse(
      store?.getItem(keyFor(device)) ?? '{}',
    ) as Partial<Variants>;
    const isKnown =
      (rasterizer === 'quads' || rasterizer === 'tiles') &&
      (accumulation === 'rgba16float' || accumulation === 'rgba32float') &&
      (threads === 'parallel' || threads === 'serial') &&
      sort !== undefined &&
      SORT_NAMES.includes(sort) &&
      canSort(device, sort);
    return isKnown ? { rasterizer, accumulation, threads, sort } : undefined;
  } catch {
    return undefined;
  }
}

function writeChoice(store: ChoiceStore | null, key: string, variants: Variants): void {
  try {
    store?.setItem(key, JSON.stringify(variants));
  } catch {
    // A full or forbidden store costs the next visit a few tenths of a second.
  }
}
