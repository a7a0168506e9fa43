import { GaussianSplatError, transposed, type GaussianCloud } from '@gaussian-splat/core';
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

/** Measures the time by kind of work. */
export class Stopwatch {
  readonly #seconds: Record<string, number> = {};
  #last = performance.now();

  /** Adds the time since the last lap to a kind of work. */
  lap(work: string): void {
    const now = performance.now();
    this.#seconds[work] = (this.#seconds[work] ?? 0) + (now - this.#last) / 1000;
    this.#last = now;
  }

  /** Seconds by kind of work. */
  get seconds(): Readonly<Record<string, number>> {
    return { ...this.#seconds };
  }
}

export interface EconomiseOptions {
  /** Minimum PSNR over the covered pixels of the held-out views for the written file, dB. */
  readonly minDecibels: number;
  /** Name of the output file, whose extension selects the format. */
  readonly name: string;
  /** Evaluates the cloud: a `GpuEvaluator`, or a wrapper of one. */
  readonly evaluator: Evaluator;
  /** Runs parallel parts of writing and reading back the file; default {@link inline}. */
  readonly pool?: TaskPool;
  /** Encodes lossless WebP for SOG: needed only for `.sog`. */
  readonly encodeWebp?: EncodeWebp;
  readonly signal?: AbortSignal;
  /** Called with a description of each step. */
  readonly onStep?: (step: string) => void;
}

/** A compressed scene, and its quality. */
export interface Economised {
  readonly bytes: Uint8Array<ArrayBuffer>;
  readonly encoding: string;
  readonly splats: { readonly before: number; readonly after: number };
  /** Coefficients of spherical harmonics above the constant one, over all splats and channels. */
  readonly coefficients: { readonly before: number; readonly after: number };
  /** Number of splats of degree 0, 1, 2 and 3. */
  readonly degrees: readonly number[];
  /** dB over the covered pixels: of all held-out views together, and of the worst one. */
  readonly decibels: number;
  readonly worstDecibels: number;
  /** Number of held-out views that show some of the scene. */
  readonly heldOutViews: number;
  readonly cut: Cut;
  /**
   * Duration of each kind of work, s: `score`, `search`, `refine`, `fit`, `write` (and read back), `judge`; with
   * several encodings `encode`.
   */
  readonly seconds: Readonly<Record<string, number>>;
}

/** Maximum fraction of the error for quantization before a finer encoding is tried. */
const ROUNDING_SHARE = 0.6;
/**
 * Factor of the cut if the written file misses the target, squared in the next try and so on. The last try keeps
 * everything.
 */
const SHRINK = 0.9;
const MAX_TRIES = 8;
/**
 * Maximum number of enlargements of the cut, the fraction of the remaining error that each uses, and the fraction of
 * the allowed error that ends them.
 */
const [MAX_EXTRA, MORE_SHARE, ENOUGH] = [3, 0.9, 0.98];
const WHOLE: Plan = { trades: { cutAt: () => ({}) }, filling: 0, isRefined: false };

/**
 * Compresses a scene to a target PSNR: scores all splats by the error of the views without them, drops the least
 * important, removes view-dependent color that is not visible, sorts the rest from coarse to fine, and writes it. The
 * error is divided between both cuts to save the most. The PSNR is measured on the written file after reading it back,
 * in held-out views: these do not influence scores or choices, and can only make the cut smaller.
 *
 * @throws GaussianSplatError `argument/value` if the format cannot reach the target, the extension of the file's name
 * is unknown, or no view shows the scene.
 */
export async function economise(cloud: GaussianCloud, options: EconomiseOptions): Promise<Economised> {
  const { minDecibels, evaluator, pool = inline, signal, onStep = () => undefined } = options;
  const encodings = encodingsFor(options.name, cloud, options);
  const watch = new Stopwatch();
  onStep(`scoring ${cloud.count} splats`);
  const ranking = await evaluator.rank(signal);
  watch.lap('score');
  const target = meanSquareOf(minDecibels);
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
 * Converts a written scene to the coordinates of its source, because formats without an up direction store it rotated.
 */
function asGiven(written: GaussianCloud, cloud: GaussianCloud): GaussianCloud {
  const rotation = written.hints?.up === undefined ? uprightRotation(cloud) : undefined;
  return rotation ? turned(written, transposed(rotation)) : written;
}

/** A file, read back and evaluated. */
interface Written extends CutCloud {
  readonly encoding: Encoding;
  readonly bytes: Uint8Array;
  /** Errors of each held-out view, and of all together. */
  readonly errors: readonly number[];
  readonly error: number;
}

/**
 * Uses the remaining error of a file, because its quantization was measured in other views, and cuts are discrete.
 * @param take Writes a file with an error that is larger by about `extra`.
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
 * Selects the smallest encoding whose quantization error leaves room for cuts. If there is only one, only the written
 * file is evaluated.
 */
async function chooseEncoding(
  cloud: GaussianCloud,
  encodings: readonly Encoding[],
  target: number,
  options: EconomiseOptions,
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

/** Copies shared memory, because many APIs reject shared buffers. */
function unshared(bytes: Uint8Array): Uint8Array<ArrayBuffer> {
  return bytes.buffer instanceof ArrayBuffer ? (bytes as Uint8Array<ArrayBuffer>) : new Uint8Array(bytes);
}

function summary(
  cloud: GaussianCloud,
  { cloud: kept, degrees }: ReducedCloud,
  cut: Cut,
  found: readonly number[],
): Omit<Economised, 'bytes' | 'encoding' | 'seconds'> {
  return {
    splats: { before: cloud.count, after: kept.count },
    coefficients: {
      before: 3 * cloud.count * ((cloud.shDegree + 1) ** 2 - 1),
      after: keptCoefficients(degrees),
    },
    degrees: degreesOf(degrees),
    decibels: decibels(errorTogether(found, 'heldOut')),
    heldOutViews: found.length,
    worstDecibels: decibels(Math.max(...found)),
    cut,
  };
}

const upperBound = (error: number): string => `at most ${decibels(error).toFixed(1)} dB, with every splat kept`;

function unreachable({ name, minDecibels }: EconomiseOptions, found: string): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: name,
    expected: `${minDecibels} dB or more in the held-out views`,
    found,
    remedy: 'write a more precise format (.ply; .glb in place of .spz), or ask for less',
  });
}
