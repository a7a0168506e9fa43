import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { cpuPainter, cpuScorer } from './cpu-raster.js';
import { decibels, mean, meanSquare, meanSquareOf, type Image, type Painter } from './measure.js';
import { keptCoefficients, reduce, type Cut, type ReducedCloud } from './reduce.js';
import { scoreSplats, type Scores } from './score.js';
import type { ContributionScorer } from './scorer.js';
import { bestTrades, measureTrades, type TradeCurve } from './search.js';
import type { DealtViews } from './views.js';
import { encodingsFor, type Encoding } from './write/index.js';

export interface EconomiseOptions {
  /** PSNR over the covered pixels of the held-out views that the written file must reach, dB. */
  readonly minDecibels: number;
  /** Name of the file to be written; its extension tells the format. */
  readonly name: string;
  /** The views of three kinds, none of which may share one: what was not seen in the first would seem unneeded in the second. */
  readonly views: DealtViews;
  /** Draws the images that the result is judged by; {@link Studio} is the project's renderer. */
  readonly studio: Painter;
  /** Draws the many small images of the search; default {@link cpuPainter}. */
  readonly sketcher?: Painter;
  /** Default: {@link cpuScorer} of the cloud. */
  readonly scorer?: ContributionScorer;
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
  readonly cut: Cut;
}

/** Share of the error that goes to rounding at most, before a finer encoding is tried. */
const ROUNDING_SHARE = 0.6;
/** How much of what is left is used at first; it shrinks until the figure is met. */
const FIRST_FILLING = 0.95;
/** Bounds on that shrinking in one step. */
const SHRINK: readonly [number, number] = [0.3, 0.9];
const MAX_TRIES = 8;
/** Shares of the splats whose absence is measured, the least missed first. */
const DROPPED_SHARES = [0.01, 0.02, 0.035, 0.05, 0.07, 0.1, 0.14, 0.19, 0.25, 0.32, 0.4, 0.5];
/** The share at which two scores are held against one another. */
const TRIAL_SHARE = 0.06;
/** Prices of a coefficient that are measured. */
const PRICES = Array.from({ length: 14 }, (_, k) => 10 ** (-14.5 + 0.5 * k));
/** Numbers that a splat has besides its harmonics. */
const OTHER_NUMBERS = 11;

/**
 * Makes a scene smaller without going below a figure: scores all splats by what the views would lack without them, drops the least missed,
 * takes view-dependent colour from splats where it does not show, orders the rest from coarse to fine, and writes it. How much of the error goes to
 * which of the two is what saves most. The figure is measured on the written file, read again, in views that had no say in the choice.
 *
 * @throws GaussianSplatError `argument/value` if the format cannot reach the figure, or the file's name is of no known format.
 */
export async function economise(cloud: GaussianCloud, options: EconomiseOptions): Promise<Economised> {
  const { minDecibels, views, studio, sketcher = cpuPainter, signal, onStep = () => undefined } = options;
  const encodings = encodingsFor(options.name);
  onStep(`scoring ${cloud.count} splats in ${views.scored.length} views`);
  const scores = await scoreSplats(cloud, views.scored, options.scorer ?? cpuScorer(cloud), signal);
  onStep('drawing the reference');
  const [seen, unseen] = [await sketcher.draw(cloud, views.searched), await studio.draw(cloud, views.heldOut)];
  const errorOf = async (reduced: GaussianCloud): Promise<number> => {
    signal?.throwIfAborted();
    return mean(errors(await sketcher.draw(reduced, views.searched), seen));
  };
  const target = meanSquareOf(minDecibels);
  const { encoding, rounding } = await chooseEncoding(cloud, scores, encodings, target, errorOf, options);
  const budget = target - rounding;
  const curves = await curvesOf(cloud, scores, errorOf, budget, onStep);
  for (let tries = 0, filling = FIRST_FILLING; tries < MAX_TRIES; tries++) {
    const [drop, colour] = bestTrades(curves.drop, curves.colour, filling * budget);
    const cut: Cut = { ...curves.cutAt(drop.threshold), colourPrice: colour.threshold };
    const reduced = reduce(cloud, scores, cut);
    const bytes = await encoding.write(reduced);
    const written = await readScene(bytes, { name: options.name, signal });
    const found = errors(await studio.draw(written, views.heldOut), unseen);
    onStep(`held-out views: ${decibels(mean(found)).toFixed(2)} dB`);
    if (mean(found) <= target) return summary(cloud, reduced, cut, bytes, encoding, found);
    filling *= Math.min(SHRINK[1], Math.max(SHRINK[0], (0.97 * target) / mean(found)));
  }
  throw unreachable(options, 'less, whatever was kept');
}

function errors(images: readonly Image[], references: readonly Image[]): number[] {
  return images.map((image, k) => meanSquare(image, references[k]));
}

const NOTHING: Cut = {};

/** The smallest way to write the scene whose rounding leaves room for more. */
async function chooseEncoding(
  cloud: GaussianCloud,
  scores: Scores,
  encodings: readonly Encoding[],
  target: number,
  errorOf: (cloud: GaussianCloud) => Promise<number>,
  options: EconomiseOptions,
): Promise<{ encoding: Encoding; rounding: number }> {
  const whole = reduce(cloud, scores, NOTHING);
  let best = Infinity;
  for (const encoding of encodings) {
    options.onStep?.(`rounding of ${encoding.title}`);
    const rounding = await errorOf(await readScene(await encoding.write(whole), { name: options.name }));
    best = Math.min(best, rounding);
    const isLast = encoding === encodings[encodings.length - 1];
    if (rounding <= ROUNDING_SHARE * target || (isLast && rounding < 0.95 * target)) return { encoding, rounding };
  }
  throw unreachable(options, `at most ${decibels(best).toFixed(1)} dB, with every splat kept`);
}

/** What can be traded for error. */
interface Curves {
  readonly drop: TradeCurve;
  readonly colour: TradeCurve;
  /** The cut that a threshold of `drop` stands for. */
  readonly cutAt: (threshold: number) => Cut;
}

/** What dropping alone costs, and what fewer bands of colour alone. */
async function curvesOf(
  cloud: GaussianCloud,
  scores: Scores,
  errorOf: (cloud: GaussianCloud) => Promise<number>,
  budget: number,
  onStep: (step: string) => void,
): Promise<Curves> {
  const numbersOf = ({ degrees }: ReducedCloud): number =>
    degrees.reduce((sum, degree) => sum + OTHER_NUMBERS + 3 * (degree + 1) ** 2, 0);
  const all = numbersOf(reduce(cloud, scores, NOTHING));
  const along = (thresholds: readonly number[], cutAt: (threshold: number) => Cut): Promise<TradeCurve> =>
    measureTrades(
      thresholds,
      async (threshold) => {
        const reduced = reduce(cloud, scores, cutAt(threshold));
        return { threshold, error: await errorOf(reduced.cloud), saved: all - numbersOf(reduced) };
      },
      budget,
    );
  onStep('measuring what dropped splats cost');
  const { prices, cutAt } = await dropsOf(cloud, scores, errorOf);
  const drop = await along(prices, cutAt);
  onStep('measuring what fewer bands of colour cost');
  const colour = await along(cloud.shDegree > 0 ? PRICES : [], (colourPrice) => ({ colourPrice }));
  return { drop, colour, cutAt };
}

/**
 * Thresholds for dropping, in the score that does better at the trial share: what single views would lack, or the largest weight in a pixel. The former
 * knows what lies behind a splat and how large it is, the latter is the more careful with what goes together; which counts for more depends on the scene.
 */
async function dropsOf(
  cloud: GaussianCloud,
  scores: Scores,
  errorOf: (cloud: GaussianCloud) => Promise<number>,
): Promise<{ prices: readonly number[]; cutAt: (threshold: number) => Cut }> {
  const candidates = [
    { values: scores.removalError, cutAt: (removalPrice: number): Cut => ({ removalPrice }) },
    { values: scores.contribution, cutAt: (minContribution: number): Cut => ({ minContribution }) },
  ].map(({ values, cutAt }) => {
    const sorted = values.slice().sort();
    const at = (share: number): number => sorted[Math.floor(share * (sorted.length - 1))];
    return { at, cutAt };
  });
  const trials: number[] = [];
  for (const { at, cutAt } of candidates)
    trials.push(await errorOf(reduce(cloud, scores, cutAt(at(TRIAL_SHARE))).cloud));
  const { at, cutAt } = candidates[trials[0] <= trials[1] ? 0 : 1];
  const prices = [...new Set(DROPPED_SHARES.map(at))].filter((price) => price > 0 && Number.isFinite(price));
  return { prices, cutAt };
}

function summary(
  cloud: GaussianCloud,
  { cloud: kept, degrees }: ReducedCloud,
  cut: Cut,
  bytes: Uint8Array<ArrayBuffer>,
  encoding: Encoding,
  found: readonly number[],
): Economised {
  const counts = [0, 0, 0, 0];
  for (const degree of degrees) counts[degree]++;
  return {
    bytes,
    encoding: encoding.title,
    splats: { before: cloud.count, after: kept.count },
    coefficients: {
      before: 3 * cloud.count * ((cloud.shDegree + 1) ** 2 - 1),
      after: keptCoefficients(degrees),
    },
    degrees: counts,
    decibels: decibels(mean(found)),
    worstDecibels: decibels(Math.max(...found)),
    cut,
  };
}

function unreachable({ name, minDecibels }: EconomiseOptions, found: string): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: name,
    expected: `${minDecibels} dB or more in the held-out views`,
    found,
    remedy: 'write a more precise format (.glb or .ply), or ask for less',
  });
}
