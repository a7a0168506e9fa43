/** Searches the fastest variants with trials of about a second, once for each adapter and origin. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { mortonOrder } from '../pack/morton.js';
import type { PackedGaussians } from '../pack/pack.js';
import { PREFERRED, FALLBACK, type Variants } from '../variants.js';
import { copiesOf, packSpheres, sphereCloud } from './spheres.js';
import { FrameClock, FRAMES, passes, timeFrames, type TimingScene } from './timing.js';

/** Rounds of trials. They are run in order until one candidate is left, or the time is used up. */
export const ROUNDS: readonly TimingScene[] = [
  { scene: () => spheres(1), width: 320, height: 180 },
  { scene: () => spheres(16), width: 1920, height: 1080 },
];
/** Number of different spheres in a scene. Packing more spheres would block the main thread. */
const SPHERES = 4_096;
/** Maximum milliseconds of all rounds together. */
const BUDGET = 800;
/** Expected ratio of the duration of a round to that of the previous one. */
const GROWTH = 16;
/** Factor of the fastest candidate's time above which a candidate is excluded. */
const HOPELESS = 1.5;
/** Minimum milliseconds of the fastest candidate in a round that excludes others. */
const MEASURABLE = 1.5;

/** Variants for software adapters. Tiles need barriers, which are slow on these adapters. */
const SERIAL: Variants = { ...FALLBACK, threads: 'serial' };
/** Variants for software adapters with float32 blending, which needs no conversion. */
const PRECISE: Variants = { ...SERIAL, accumulation: 'rgba32float' };
/** Milliseconds of the smallest trial from which on an adapter may be a software adapter. */
const NO_GPU_MS = 60;
type Pause = () => Promise<void>;

/** Returns the fastest variants that draw the correct image on a device; undefined if no variant does. */
export async function searchVariants(device: GPUDevice, pause: Pause): Promise<Variants | undefined> {
  const processors = device.features.has('float32-blendable') ? [SERIAL, PRECISE] : [SERIAL];
  const preferred = device.adapterInfo?.isFallbackAdapter ? processors : [PREFERRED, FALLBACK];
  const candidates = await rightOf(device, preferred, pause);
  const clock = await FrameClock.on(device);
  // A slow adapter may be a software adapter that does not report itself as one.
  if (preferred !== processors && !(await isQuick(device, candidates, clock)))
    candidates.push(...(await rightOf(device, processors, pause)));
  if (candidates.length > 0) return chooseFastest(device, candidates, clock, pause);
  for (const candidate of LAST_RESORTS) if (await passes(device, candidate)) return candidate;
  return undefined;
}

/** Variants that are tried in order if no candidate draws the correct image. */
const LAST_RESORTS: readonly Variants[] = [PREFERRED, FALLBACK, SERIAL, { ...PREFERRED, threads: 'serial' }];

async function rightOf(device: GPUDevice, candidates: readonly Variants[], pause: Pause): Promise<Variants[]> {
  const right: Variants[] = [];
  for (const candidate of candidates) {
    await pause();
    if (await passes(device, candidate)) right.push(candidate);
  }
  return right;
}

async function isQuick(device: GPUDevice, [first]: readonly Variants[], clock: FrameClock): Promise<boolean> {
  return first !== undefined && (await timeFrames(device, first, ROUNDS[0], clock)) < NO_GPU_MS;
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
    // Only GPU time counts, because compiled pipelines are reused.
    const last = FRAMES * left.reduce((sum, { time }) => sum + time, 0);
    // A clock that does not advance cannot compare candidates. The result of the smaller round is then used.
    const isBlind = last === 0 && round !== ROUNDS[0];
    if (left.length === 1 || isBlind || spent + GROWTH * last > BUDGET) break;
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

/** Returns the error for a device on which no variant draws the correct image. */
export function wrongImage({ adapterInfo }: GPUDevice): GaussianSplatError {
  const { vendor = '', architecture = '', description = '' } = adapterInfo ?? {};
  return new GaussianSplatError('unsupported/wrong-image', {
    where: `the graphics adapter ${[vendor, architecture, description].filter(Boolean).join(' ') || '(unnamed)'}`,
    expected: 'the image of the self-test',
    found: 'another image from every variant of the renderer',
    remedy: 'update the browser and the graphics driver, and report it with this message',
  });
}

/** Returns a scene of `copies` copies of the same spheres at the same positions. */
function spheres(copies: number): PackedGaussians {
  const cloud = sphereCloud(SPHERES, Math.cbrt(400 / (copies * SPHERES)));
  const order = mortonOrder(
    cloud.positions,
    Uint32Array.from({ length: SPHERES }, (_, i) => i),
  );
  return copiesOf(packSpheres(cloud, 'int8', order), copies);
}
