import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { cpuPainter, cpuScorer } from './cpu-raster.js';
import { decibels, mean, meanSquare, meanSquareOf, type Image, type Painter } from './measure.js';
import { keptCoefficients, reduce, type Cut, type ReducedCloud } from './reduce.js';
import { scoreSplats, type Scores } from './score.js';
import type { ContributionScorer } from './scorer.js';
import { Curve } from './search.js';
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
/** Share of what is left that goes to dropped splats. */
const DROP_SHARE = 0.5;
/** How much of what is left is used at first; it shrinks until the figure is met. */
const FIRST_FILLING = 0.95;
/** Bounds on that shrinking in one step. */
const SHRINK: readonly [number, number] = [0.3, 0.9];
const MAX_TRIES = 8;
const CONTRIBUTION_RANGE: readonly [number, number] = [1e-4, 0.3];
const PRICE_RANGE: readonly [number, number] = [1e-16, 1e-8];

/**
 * Makes a scene smaller without going below a figure: scores all splats by what they contribute to the views, drops the least seen,
 * takes view-dependent colour from splats where it does not show, orders the rest from coarse to fine, and writes it. The figure is
 * measured on the written file, read again, in views that had no say in the choice.
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
  const curves = curvesOf(cloud, scores, errorOf);
  for (let tries = 0, filling = FIRST_FILLING; tries < MAX_TRIES; tries++) {
    const budget = filling * (target - rounding);
    onStep(`searching thresholds, ${Math.round(100 * filling)} % of the error that is allowed`);
    const hasColour = cloud.shDegree > 0;
    const drop = await curves.drop.thresholdFor(hasColour ? DROP_SHARE * budget : budget, ...CONTRIBUTION_RANGE);
    // What dropping leaves of its share goes to colour.
    const colour = hasColour ? await curves.colour.thresholdFor(budget - drop.error, ...PRICE_RANGE) : undefined;
    const cut: Cut = { minContribution: drop.threshold, colourPrice: colour?.threshold ?? 0 };
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

const NOTHING: Cut = { minContribution: 0, colourPrice: 0 };

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

function curvesOf(
  cloud: GaussianCloud,
  scores: Scores,
  errorOf: (cloud: GaussianCloud) => Promise<number>,
): { drop: Curve; colour: Curve } {
  const at = (cut: Partial<Cut>): Promise<number> => errorOf(reduce(cloud, scores, { ...NOTHING, ...cut }).cloud);
  return {
    drop: new Curve((minContribution) => at({ minContribution })),
    colour: new Curve((colourPrice) => at({ colourPrice })),
  };
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
