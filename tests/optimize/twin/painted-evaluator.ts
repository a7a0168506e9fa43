import type { GaussianCloud } from '@gaussian-splat/core';
import {
  degreesOf,
  meanSquare,
  type Cut,
  type CutFigures,
  type ViewSplit,
  type Evaluator,
  type Image,
  type EvaluationViews,
  type Ranking,
  type ReducedCloud,
  type Scores,
} from '@gaussian-splat/optimize';
import { reduce } from './reduce.js';
import { isCovered, type Painter } from './painter.js';
import { cpuPainter, cpuScorer } from './raster.js';
import { scoreSplats } from './score.js';
import type { ContributionScorer } from './scorer.js';

export interface PaintedEvaluatorOptions {
  /** The views of three kinds, which must not overlap: a splat unseen in the first would seem unneeded in the second. */
  readonly views: ViewSplit;
  /** Draws the held-out views of clouds to compare: these judge the result. Default {@link cpuPainter}; {@link Studio} is the project's renderer. */
  readonly studio?: Painter;
  /** Draws all other images; default {@link cpuPainter}. */
  readonly sketcher?: Painter;
  /** Default: {@link cpuScorer} of the cloud. */
  readonly scorer?: ContributionScorer;
}

/** Scores in plain code, and draws each reduced cloud again: the reference of the GPU's evaluator, and the evaluator in tests of searches. */
export class PaintedEvaluator implements Evaluator {
  readonly #cloud: GaussianCloud;
  readonly #options: PaintedEvaluatorOptions;
  /** Images of the whole scene, by painter and views. */
  readonly #whole = new Map<Painter, Map<EvaluationViews, Promise<Image[]>>>();
  #scores: Scores | undefined;

  constructor(cloud: GaussianCloud, options: PaintedEvaluatorOptions) {
    this.#cloud = cloud;
    this.#options = options;
  }

  async rank(signal?: AbortSignal): Promise<Ranking> {
    const { views, scorer = cpuScorer(this.#cloud) } = this.#options;
    this.#scores = await scoreSplats(this.#cloud, views.scored, scorer, signal);
    return this.#scores;
  }

  async scores(): Promise<Scores> {
    return this.#scores ?? Promise.reject(new Error('PaintedEvaluator: rank() comes before scores()'));
  }

  async cut(cut: Cut, views: EvaluationViews, signal?: AbortSignal): Promise<CutFigures> {
    const { cloud, degrees } = reduce(this.#cloud, await this.scores(), cut);
    return { errors: await this.sketch(cloud, views, signal), degrees: degreesOf(degrees) };
  }

  async reduce(cut: Cut, signal?: AbortSignal): Promise<ReducedCloud> {
    signal?.throwIfAborted();
    return reduce(this.#cloud, await this.scores(), cut);
  }

  async compare(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]> {
    const { studio = cpuPainter, sketcher = cpuPainter } = this.#options;
    return this.#errors(cloud, views, views === 'heldOut' ? studio : sketcher, signal);
  }

  async sketch(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]> {
    return this.#errors(cloud, views, this.#options.sketcher ?? cpuPainter, signal);
  }

  destroy(): void {
    this.#whole.clear();
  }

  async #errors(
    cloud: GaussianCloud,
    views: EvaluationViews,
    painter: Painter,
    signal: AbortSignal | undefined,
  ): Promise<readonly number[]> {
    signal?.throwIfAborted();
    const expected = await this.#wholeBy(painter, views);
    signal?.throwIfAborted();
    const images = await painter.draw(cloud, this.#options.views[views]);
    return images.flatMap((image, k) => (isCovered(expected[k]) ? [meanSquare(image, expected[k])] : []));
  }

  #wholeBy(painter: Painter, views: EvaluationViews): Promise<Image[]> {
    const drawn = this.#whole.get(painter) ?? new Map<EvaluationViews, Promise<Image[]>>();
    this.#whole.set(painter, drawn);
    const known = drawn.get(views) ?? painter.draw(this.#cloud, this.#options.views[views]);
    drawn.set(views, known);
    return known;
  }
}
