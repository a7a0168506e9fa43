import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import type { Evaluator } from './evaluator.js';
import { findTrades, numbersOf, scaleToFit } from './fit.js';
import { decibels, errorTogether, meanSquareOf } from './measure.js';
import { readInParts } from './parts/read-in-parts.js';
import { inline, type TaskPool } from './parts/task-pool.js';
import { degreesOf, keptCoefficients, type Cut, type ReducedCloud } from './reduce.js';
import { cutCloud, searchRefined, type CutCloud, type Plan } from './refine/search-refined.js';
import { encodingsFor, type Encoding } from './write/index.js';
import type { EncodeWebp } from './write/sog.js';

/** Where the time goes. */
export class Stopwatch {
  readonly #seconds: Record<string, number> = {};
  #last = performance.now();

  /** Adds what has passed since the last lap to a kind of work. */
  lap(work: string): void {
    const now = performance.now();
    this.#seconds[work] = (this.#seconds[work] ?? 0) + (now - this.#last) / 1000;
    this.#last = now;
  }

  /** By the kind of work, s. */
  get seconds(): Readonly<Record<string, number>> {
    return { ...this.#seconds };
  }
}

export interface EconomiseOptions {
  /** PSNR over the covered pixels of the held-out views that the written file must reach, dB. */
  readonly minDecibels: number;
  /** Name of the file to be written; its extension tells the format. */
  readonly name: string;
  /** Looks at the cloud: `GpuEvaluator`, or one around it. */
  readonly evaluator: Evaluator;
  /** Does what comes in parts, of writing and reading the file again; default {@link inline}. */
  readonly pool?: TaskPool;
  /** Encodes lossless WebP, of which SOG is made: for `.sog` alone. */
  readonly encodeWebp?: EncodeWebp;
  readonly signal?: AbortSignal;
  /** Searches at most, of formats whose steps are chosen: one that leaves more than was asked is followed by one that aims lower; default 4. */
  readonly searches?: number;
  /** Called with what is being done. */
  readonly onStep?: (step: string) => void;
}

/** A scene made smaller, and what that cost. */
export interface Economised {
  readonly bytes: Uint8Array<ArrayBuffer>;
  readonly encoding: string;
  readonly splats: { readonly before: number; readonly after: number };
  /** Coefficients of spherical harmonics above the constant one, all splats and channels. */
  readonly coefficients: { readonly before: number; readonly after: number };
  /** Splats of degree 0, 1, 2 and 3. */
  readonly degrees: readonly number[];
  /** dB over the covered pixels: of all held-out views together, and of the worst of them. */
  readonly decibels: number;
  readonly worstDecibels: number;
  /** How many held-out views these are: those that show some of the scene. */
  readonly heldOutViews: number;
  readonly cut: Cut;
  /** How long each kind of work took, s: `score`, `search`, `refine`, `fit`, `write` (and read again), `judge`; with several encodings `encode`. */
  readonly seconds: Readonly<Record<string, number>>;
}

/** Share of the error that goes to rounding at most, before a finer encoding is tried. */
const ROUNDING_SHARE = 0.6;
/** How much less is taken where the written file misses the figure; the next time as much less again than that. The last try keeps everything. */
const SHRINK = 0.9;
const MAX_TRIES = 8;
const USUAL_SEARCHES = 4;
/** How much more than what was asked is worth another search, dB, and which part of that it aims lower. */
const [SURPLUS, AIM_SHARE] = [0.1, 0.8];
const WHOLE: Plan = { trades: { cutAt: () => ({}) }, filling: 0, isRefined: false };

/**
 * Makes a scene smaller without going below a figure: scores all splats by what the views would lack without them, drops the least missed,
 * takes view-dependent colour from splats where it does not show, orders the rest from coarse to fine, and writes it. How much of the error goes to
 * which of the two is what saves most. The figure is measured on the written file, read again, in held-out
 * views: they scored and chose nothing, and could only ask for a smaller cut.
 *
 * @throws GaussianSplatError `argument/value` if the format cannot reach the figure, the file's name is of no known format, or views show nothing of the scene.
 */
export async function economise(cloud: GaussianCloud, options: EconomiseOptions): Promise<Economised> {
  const watch = new Stopwatch();
  const { minDecibels, searches = USUAL_SEARCHES } = options;
  let best = await economiseTo(meanSquareOf(minDecibels), cloud, options, watch);
  if (!encodingsFor(options.name, cloud, options).some(({ tune }) => tune)) return best;
  // What steps, palettes and cuts make together comes in jumps: a search that aims lower may find a smaller file that is still near enough.
  let [aim, tooLow] = [minDecibels, -Infinity];
  for (let tries = 1; tries < searches && best.decibels > minDecibels + SURPLUS; tries++) {
    const next = Math.max(aim - AIM_SHARE * (best.decibels - minDecibels), (aim + tooLow) / 2);
    options.onStep?.(`another search, for ${next.toFixed(2)} dB`);
    const other = await economiseTo(meanSquareOf(next), cloud, options, watch).catch((error: unknown) => {
      if (error instanceof GaussianSplatError && error.code === 'argument/value') return undefined;
      throw error;
    });
    const isSmaller = other && other.decibels >= minDecibels && other.bytes.length < best.bytes.length;
    [aim, tooLow, best] = isSmaller ? [next, tooLow, other] : [aim, next, best];
  }
  return { ...best, seconds: watch.seconds };
}

/** @param target mean squared error that is searched for */
async function economiseTo(
  target: number,
  cloud: GaussianCloud,
  options: EconomiseOptions,
  watch: Stopwatch,
): Promise<Economised> {
  const { evaluator, pool = inline, signal, onStep = () => undefined } = options;
  const encodings = encodingsFor(options.name, cloud, options);
  onStep(`scoring ${cloud.count} splats`);
  const ranking = await evaluator.rank(signal);
  watch.lap('score');
  const { encoding, rounding } = await chooseEncoding(cloud, encodings, target, options);
  watch.lap('encode');
  const budget = Math.max(0, target - rounding);
  const { hasOneDegree } = encoding;
  const fitting = { signal, onStep, hasOneDegree };
  const trades = await findTrades(cloud, ranking, evaluator, budget, fitting);
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
  for (let tries = 1; ; tries++) {
    const { cut, reduced } = ready ?? (await cutCloud(plan, evaluator, budget, signal));
    const bytes = await encoding.write(reduced, pool);
    const written = await readInParts(bytes, { name: options.name, signal }, pool);
    watch.lap('write');
    const errors = await evaluator.compare(written, 'heldOut', signal);
    watch.lap('judge');
    const error = errorTogether(errors, 'heldOut');
    onStep(`held-out views: ${decibels(error).toFixed(2)} dB`);
    if (error <= target)
      return {
        ...summary(cloud, reduced, cut, errors),
        bytes: unshared(bytes),
        encoding: encoding.title,
        seconds: watch.seconds,
      };
    if (plan === WHOLE) throw unreachable(options, atMost(error));
    const isLast = tries + 1 >= MAX_TRIES || plan.filling === 0;
    plan = isLast ? WHOLE : { ...plan, filling: SHRINK ** tries * plan.filling };
    ready = undefined;
  }
}

/** The smallest way to write the scene whose rounding leaves room for more. Where there is but one, the written file alone is judged. */
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
    const rounded = await readScene(bytes, { name: options.name });
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
  throw unreachable(options, atMost(best));
}

/** The same bytes in memory that is nobody else's: much that takes bytes refuses shared ones. */
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

const atMost = (error: number): string => `at most ${decibels(error).toFixed(1)} dB, with every splat kept`;

function unreachable({ name, minDecibels }: EconomiseOptions, found: string): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: name,
    expected: `${minDecibels} dB or more in the held-out views`,
    found,
    remedy: 'write a more precise format (.ply; .glb in place of .spz), or ask for less',
  });
}
