/** The autotuning search: a second of trials, once for each adapter and origin. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { mortonOrder } from '../pack/morton.js';
import type { PackedGaussians } from '../pack/pack.js';
import { PREFERRED, FALLBACK, type Variants } from '../variants.js';
import { packSpheres, sphereCloud } from './self-test.js';
import { FrameClock, FRAMES, passes, timeFrames, type TimingScene } from './timing.js';

/** Rounds run until one candidate is left, or the time is up. */
export const ROUNDS: readonly TimingScene[] = [
  { scene: () => spheres(1), width: 320, height: 180 },
  { scene: () => spheres(16), width: 1920, height: 1080 },
];
/** Spheres of a scene: packing more of them would block the main thread. */
const SPHERES = 4_096;
/** Milliseconds for all rounds, and the expected ratio of one round's duration to the previous one's. */
const BUDGET = 800;
const GROWTH = 16;
/** A candidate slower than the fastest by this factor is excluded, in a round of at least MEASURABLE ms. */
const HOPELESS = 1.5;
const MEASURABLE = 1.5;

/** Variants for software adapters: tiles need barriers, which are slow there. float32 quads need no conversion. */
const SERIAL: Variants = { ...FALLBACK, threads: 'serial' };
const PRECISE: Variants = { ...SERIAL, accumulation: 'rgba32float' };
/** Milliseconds of the smallest trial that no GPU exceeds. */
const NO_GPU_MS = 60;
type Pause = () => Promise<void>;

/** Returns the fastest variants that draw the right image on a device; undefined if none does. */
export async function searchVariants(device: GPUDevice, pause: Pause): Promise<Variants | undefined> {
  const processors = device.features.has('float32-blendable') ? [SERIAL, PRECISE] : [SERIAL];
  const preferred = device.adapterInfo?.isFallbackAdapter ? processors : [PREFERRED, FALLBACK];
  const candidates = await rightOf(device, preferred, pause);
  const clock = await FrameClock.on(device);
  // A software adapter that does not report itself as one.
  if (preferred !== processors && !(await isQuick(device, candidates, clock)))
    candidates.push(...(await rightOf(device, processors, pause)));
  if (candidates.length > 0) return chooseFastest(device, candidates, clock, pause);
  for (const candidate of LAST_RESORTS) if (await passes(device, candidate)) return candidate;
  return undefined;
}

/** Variants that are right, however slow: their speed excluded them before. */
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
    // Only GPU time counts: compiled pipelines are reused.
    const last = FRAMES * left.reduce((sum, { time }) => sum + time, 0);
    // A clock that does not advance cannot compare candidates, so the small round decides.
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

/** Error for a device on which no variant draws the right image. */
export function wrongImage({ adapterInfo }: GPUDevice): GaussianSplatError {
  const { vendor = '', architecture = '', description = '' } = adapterInfo ?? {};
  return new GaussianSplatError('unsupported/wrong-image', {
    where: `the graphics adapter ${[vendor, architecture, description].filter(Boolean).join(' ') || '(unnamed)'}`,
    expected: 'the image of the self-test',
    found: 'another image from every variant of the renderer',
    remedy: 'update the browser and the graphics driver, and report it with this message',
  });
}

/** A scene of this many copies of the same spheres at the same positions. */
function spheres(copies: number): PackedGaussians {
  const cloud = sphereCloud(SPHERES, Math.cbrt(400 / (copies * SPHERES)));
  const order = mortonOrder(
    cloud.positions,
    Uint32Array.from({ length: SPHERES }, (_, i) => i),
  );
  const { geometry, sh, chunks, ...facts } = packSpheres(cloud, 'int8', order);
  const copied = <T extends Uint32Array | Float32Array>(words: T, all: T): T => {
    for (let k = 0; k < copies; k++) all.set(words, k * words.length);
    return all;
  };
  return {
    ...facts,
    count: copies * SPHERES,
    geometry: copied(geometry, new Uint32Array(copies * geometry.length)),
    sh: copied(sh, new Uint32Array(copies * sh.length)),
    chunks: copied(chunks, new Float32Array(copies * chunks.length)),
  };
}
