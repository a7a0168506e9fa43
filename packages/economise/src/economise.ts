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
/** How often more is taken, of which part of what is left, and from which part of the allowed error on that is not worth another try. */
const [MOST_MORE, MORE_SHARE, ENOUGH] = [3, 0.9, 0.98];
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
    if (plan === WHOLE) throw unreachable(options, atMost(found.error));
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

/** A written scene in the frame of the one that it was made of: formats without a place for up have it turned. */
function asGiven(written: GaussianCloud, cloud: GaussianCloud): GaussianCloud {
  const rotation = written.hints?.up === undefined ? uprightRotation(cloud) : undefined;
  return rotation ? turned(written, transposed(rotation)) : written;
}

/** A file, read again and judged. */
interface Written extends CutCloud {
  readonly encoding: Encoding;
  readonly bytes: Uint8Array;
  /** Of each held-out view, and of all together. */
  readonly errors: readonly number[];
  readonly error: number;
}

/**
 * Takes what a file leaves of the error that is allowed: its rounding was measured in other views, and cuts come in jumps.
 * @param take writes a file whose error is larger by about `extra`
 */
async function takeMore(found: Written, target: number, take: (extra: number) => Promise<Written>): Promise<Written> {
  let [best, low, high] = [found, 0, Infinity];
  for (let tries = 0; tries < MOST_MORE && best.error < ENOUGH * target; tries++) {
    const next = Math.min(low + MORE_SHARE * (target - best.error), (low + high) / 2);
    const other = await take(next);
    if (other.error > target || other.bytes.length >= best.bytes.length) high = next;
    else [best, low] = [other, next];
  }
  return best;
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
