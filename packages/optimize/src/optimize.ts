import { GaussianSplatError, multiply3, transposed, type GaussianCloud } from '@gaussian-splat/core';
import { readScene, turned, uprightRotation } from '@gaussian-splat/formats';
import type { Evaluator } from './evaluator.js';
import { findTrades, numbersOf, scaleToFit } from './fit.js';
import { decibels, errorTogether, meanSquareOf } from './measure.js';
import { readInParts } from './parts/read-in-parts.js';
import { inline, type TaskPool } from './parts/task-pool.js';
import { degreesOf, keptCoefficients, type Cut, type ReducedCloud } from './reduce.js';
import { cutCloud, searchRefined, type CutCloud, type Plan } from './refine/search-refined.js';
import { encodingsFor, type Encoding } from './write/index.js';
import type { EncodeWebp } from './write/sog.js';

/** Measures the duration of work of several kinds. */
export class Stopwatch {
  readonly #seconds: Record<string, number> = {};
  #last = performance.now();

  /** Adds the time since the previous call, or since the construction, to a kind of work. */
  lap(work: string): void {
    const now = performance.now();
    this.#seconds[work] = (this.#seconds[work] ?? 0) + (now - this.#last) / 1000;
    this.#last = now;
  }

  /** Duration in seconds of each kind of work. */
  get seconds(): Readonly<Record<string, number>> {
    return { ...this.#seconds };
  }
}

export interface OptimizeOptions {
  /** Minimum PSNR of the written file in dB, over the covered pixels of the held-out views. */
  readonly minPsnr: number;
  /** Name of the output file, whose extension selects the format. */
  readonly name: string;
  /** Evaluator of the cloud: a `GpuEvaluator`, or a wrapper of one. */
  readonly evaluator: Evaluator;
  /** Pool that runs parallel parts of writing and reading the file; default {@link inline}. */
  readonly pool?: TaskPool;
  /** Encoder of lossless WebP. Required for SOG only. */
  readonly encodeWebp?: EncodeWebp;
  readonly signal?: AbortSignal;
  /** Called with a description of each step. */
  readonly onStep?: (step: string) => void;
}

/** A compressed scene file, and its measured quality. */
export interface Optimized {
  readonly bytes: Uint8Array<ArrayBuffer>;
  readonly encoding: string;
  readonly splats: { readonly before: number; readonly after: number };
  /** Number of coefficients of spherical harmonics above the constant one, over all splats and channels. */
  readonly coefficients: { readonly before: number; readonly after: number };
  /** Number of splats of degree 0, 1, 2 and 3. */
  readonly degrees: readonly number[];
  /** PSNR of all held-out views together in dB, over the covered pixels. */
  readonly psnr: number;
  /** PSNR of the held-out view with the largest error in dB, over the covered pixels. */
  readonly worstPsnr: number;
  /** Number of held-out views that show some of the scene. */
  readonly heldOutViews: number;
  readonly cut: Cut;
  /**
   * Duration in seconds of each kind of work: `score`, `encode` (choice of the encoding), `search`, `fit`, `refine`,
   * `write` (including reading the file) and `judge`.
   */
  readonly seconds: Readonly<Record<string, number>>;
}

/** Maximum fraction of the allowed error that quantization may cause. Beyond it, a finer encoding is tried. */
const ROUNDING_SHARE = 0.6;
/**
 * Factor of the error that cuts may cause, if the written file misses the target. Retry n uses its n-th power. The last
 * retry keeps all splats and coefficients.
 */
const SHRINK = 0.9;
const MAX_TRIES = 8;
/**
 * Maximum number of enlargements of the cut; fraction of the remaining error that each enlargement uses; fraction of the
 * allowed error that ends them.
 */
const [MAX_EXTRA, MORE_SHARE, ENOUGH] = [3, 0.9, 0.98];
const WHOLE: Plan = { trades: { cutAt: () => ({}) }, filling: 0, isRefined: false };

/**
 * Compresses a scene to a target PSNR. Scores all splats by the error of views without them, drops the least important
 * splats, and removes view-dependent color that is not visible. The allowed error is divided between these cuts so that
 * they save the most. The file has the remaining splats from coarse to fine. PSNR is measured on the written file in
 * held-out views, which do not influence scores, and can only make the cut smaller.
 *
 * @throws GaussianSplatError `argument/value` if the format cannot reach the target, the extension of the file's name
 * is unknown, or no view shows the scene.
 */
export async function optimize(cloud: GaussianCloud, options: OptimizeOptions): Promise<Optimized> {
  const { minPsnr, evaluator, pool = inline, signal, onStep = () => undefined } = options;
  const encodings = encodingsFor(options.name, cloud, options);
  const watch = new Stopwatch();
  onStep(`scoring ${cloud.count} splats`);
  const ranking = await evaluator.rank(signal);
  watch.lap('score');
  const target = meanSquareOf(minPsnr);
  const { encoding, rounding } = await chooseEncoding(cloud, encodings, target, options);
  watch.lap('encode');
  const budget = Math.max(0, target - rounding);
  const { hasOneDegree } = encoding;
  const fitting = { signal, onStep, hasOneDegree };
  const trades = await findTrades(cloud, ranking, evaluator, encoding.coarser ? target : budget, fitting);
  watch.lap('search');
  let plan: Plan = { trades, filling: await scaleToFit(trades, evaluator, budget, fitting), isRefined: false };
  watch.lap('fit');
  let ready: CutCloud | undefined;
  if (evaluator.refine) {
    ready = await cutCloud(plan, evaluator, budget, signal);
    const refined = await searchRefined(cloud, ranking, evaluator, budget, fitting);
    const taken = ({ reduced }: CutCloud): number => numbersOf(degreesOf(reduced.degrees), hasOneDegree);
    if (refined && taken(refined) < taken(ready)) [plan, ready] = [refined.plan, refined];
    watch.lap('refine');
  }
  const write = async ({ cut, reduced }: CutCloud, by = encoding): Promise<Written> => {
    const bytes = await by.write({ ...reduced, cloud: { ...reduced.cloud, hints: cloud.hints } }, pool);
    const written = asGiven(await readInParts(bytes, { name: options.name, signal }, pool), cloud);
    watch.lap('write');
    const errors = await evaluator.compare(written, 'heldOut', signal);
    watch.lap('judge');
    const error = errorTogether(errors, 'heldOut');
    onStep(`held-out views: ${decibels(error).toFixed(2)} dB`);
    return { error, bytes, cut, reduced, errors, encoding: by };
  };
  let found = await write(ready ?? (await cutCloud(plan, evaluator, budget, signal)));
  for (let tries = 2; found.error > target; tries++) {
    if (plan === WHOLE) throw unreachable(options, upperBound(found.error));
    const isLast = tries >= MAX_TRIES || plan.filling === 0;
    plan = isLast ? WHOLE : { ...plan, filling: SHRINK ** (tries - 1) * plan.filling };
    found = await write(await cutCloud(plan, evaluator, budget, signal));
  }
  const { coarser } = encoding;
  if (coarser && rounding > 0) {
    found = await takeMore(found, target, (extra) => write(found, coarser(Math.sqrt(1 + extra / rounding))));
    if (!plan.isRefined && plan !== WHOLE) {
      found = await takeMore(found, target, async (extra) => {
        const allowed = budget + extra;
        const filling = await scaleToFit(trades, evaluator, allowed, fitting);
        return write(await cutCloud({ ...plan, filling }, evaluator, allowed, signal), found.encoding);
      });
    }
  }
  const { bytes, cut, reduced, errors } = found;
  return {
    ...summary(cloud, reduced, cut, errors),
    bytes: unshared(bytes),
    encoding: found.encoding.title,
    seconds: watch.seconds,
  };
}

/**
 * Returns a written scene in the coordinates of its source `cloud`. Formats without a direction up store rotated scenes,
 * and others have another one.
 */
export function asGiven(written: GaussianCloud, cloud: GaussianCloud): GaussianCloud {
  const none = [1, 0, 0, 0, 1, 0, 0, 0, 1];
  const [toUpright, ofGiven] = [written, cloud].map((one) => uprightRotation(one) ?? none);
  const rotation = multiply3(transposed(ofGiven), toUpright);
  const isIdentity = rotation.every((value, k) => Math.abs(value - Number(k % 4 === 0)) < 1e-12);
  return isIdentity ? written : turned(written, rotation);
}

/** A written file with its errors, measured after reading it. */
interface Written extends CutCloud {
  readonly encoding: Encoding;
  readonly bytes: Uint8Array;
  /** Mean squared error of each held-out view, peak 1. */
  readonly errors: readonly number[];
  /** Mean squared error of all held-out views together. */
  readonly error: number;
}

/**
 * Writes smaller files while the error is below the allowed one, and returns the smallest file within `target`. An error
 * may remain because quantization was measured in other views, and cuts are discrete.
 * @param target Allowed mean squared error.
 * @param take Writes a file whose mean squared error is larger by about `extra`.
 */
async function takeMore(found: Written, target: number, take: (extra: number) => Promise<Written>): Promise<Written> {
  let [best, low, high] = [found, 0, Infinity];
  for (let tries = 0; tries < MAX_EXTRA && best.error < ENOUGH * target; tries++) {
    const next = Math.min(low + MORE_SHARE * (target - best.error), (low + high) / 2);
    const other = await take(next);
    if (other.error > target || other.bytes.length >= best.bytes.length) high = next;
    else [best, low] = [other, next];
  }
  return best;
}

/**
 * Returns the smallest encoding with a quantization error of at most {@link ROUNDING_SHARE} of the target, and this error
 * (`rounding`, a mean squared error). A single encoding without steps is not measured; its `rounding` is 0.
 */
async function chooseEncoding(
  cloud: GaussianCloud,
  encodings: readonly Encoding[],
  target: number,
  options: OptimizeOptions,
): Promise<{ encoding: Encoding; rounding: number }> {
  const [{ tune }] = encodings;
  if (encodings.length === 1 && tune === undefined) return { encoding: encodings[0], rounding: 0 };
  const degrees = new Uint8Array(cloud.count).fill(cloud.shDegree);
  const whole = { cloud, degrees };
  const measure = async (bytes: Uint8Array): Promise<number> => {
    const rounded = asGiven(await readScene(bytes, { name: options.name }), cloud);
    return errorTogether(await options.evaluator.compare(rounded, 'searched', options.signal), 'searched');
  };
  if (tune) {
    options.onStep?.('steps of each attribute');
    const encoding = await tune(whole, measure, ROUNDING_SHARE * target, await options.evaluator.seen?.());
    options.onStep?.(encoding.title);
    return { encoding, rounding: await measure(await encoding.write(whole)) };
  }
  let best = Infinity;
  for (const encoding of encodings) {
    options.onStep?.(`rounding of ${encoding.title}`);
    const rounding = await measure(await encoding.write(whole));
    best = Math.min(best, rounding);
    const isLast = encoding === encodings[encodings.length - 1];
    if (rounding <= ROUNDING_SHARE * target || (isLast && rounding < 0.95 * target)) return { encoding, rounding };
  }
  throw unreachable(options, upperBound(best));
}

/** Returns the bytes in an ArrayBuffer: a copy if they are in shared memory, which many APIs reject. */
function unshared(bytes: Uint8Array): Uint8Array<ArrayBuffer> {
  return bytes.buffer instanceof ArrayBuffer ? (bytes as Uint8Array<ArrayBuffer>) : new Uint8Array(bytes);
}

function summary(
  cloud: GaussianCloud,
  { cloud: kept, degrees }: ReducedCloud,
  cut: Cut,
  found: readonly number[],
): Omit<Optimized, 'bytes' | 'encoding' | 'seconds'> {
  return {
    splats: { before: cloud.count, after: kept.count },
    coefficients: {
      before: 3 * cloud.count * ((cloud.shDegree + 1) ** 2 - 1),
      after: keptCoefficients(degrees),
    },
    degrees: degreesOf(degrees),
    psnr: decibels(errorTogether(found, 'heldOut')),
    heldOutViews: found.length,
    worstPsnr: decibels(Math.max(...found)),
    cut,
  };
}

const upperBound = (error: number): string => `at most ${decibels(error).toFixed(1)} dB, with every splat kept`;

function unreachable({ name, minPsnr }: OptimizeOptions, found: string): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: name,
    expected: `${minPsnr} dB or more in the held-out views`,
    found,
    remedy: 'write a more precise format (.ply; .glb in place of .spz), or ask for less',
  });
}
