import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import type { CutFigures, Evaluator, EvaluationViews } from '../evaluator.js';
import { EvaluatorLayer } from '../evaluator-layer.js';
import { inline, type TaskPool } from '../parts/task-pool.js';
import { degreesOf, type Cut, type ReducedCloud } from '../reduce.js';
import type { Ranking } from '../score.js';
import { applyMerges } from './apply-merges.js';
import { findMerges, type Merges } from './find-merges.js';

export interface MergingOptions {
  /** Views for evaluating pairs: the scoring views. */
  readonly views: readonly Camera[];
  /** Limit of the estimated cost of merges: the mean squared error of images at the target PSNR. */
  readonly maxError: number;
  /** Finds merges in parallel; default {@link inline}. */
  readonly pool?: TaskPool;
}

/** Fractions of all splats at whose prices the cost of merging is measured, 0..1, ascending. */
const MERGED_SHARES = [0.01, 0.02, 0.035, 0.05, 0.07, 0.1, 0.14, 0.19, 0.25, 0.32, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

/**
 * An evaluator that adds merging to the cuts of another one. Merges are found and applied in TypeScript, in threads if
 * available; their cost is measured on images by the other evaluator, which draws the merged cloud.
 */
export class MergingEvaluator extends EvaluatorLayer {
  readonly #cloud: GaussianCloud;
  readonly #options: MergingOptions;
  #merges: Merges | undefined;

  /**
   * @param inner Is destroyed with this one.
   * @param cloud The cloud that `inner` evaluates.
   */
  constructor(inner: Evaluator, cloud: GaussianCloud, options: MergingOptions) {
    super(inner);
    this.#cloud = cloud;
    this.#options = options;
  }

  /** Limits of price that merge the fractions `MERGED_SHARES` of all splats: mean squared errors, ascending. */
  override get mergePrices(): readonly number[] {
    const prices = this.#found.prices.slice().sort();
    const places = MERGED_SHARES.map((share) => Math.floor(share * this.#cloud.count) - 1);
    return [...new Set(places.filter((k) => k >= 0 && k < prices.length).map((k) => prices[k]))];
  }

  override async rank(signal?: AbortSignal): Promise<Ranking> {
    const ranking = await this.inner.rank(signal);
    signal?.throwIfAborted();
    const { views, maxError, pool = inline } = this.#options;
    this.#merges ??= await findMerges(this.#cloud, ranking, views, maxError, pool);
    return ranking;
  }

  override async cut(cut: Cut, views: EvaluationViews, signal?: AbortSignal): Promise<CutFigures> {
    if (!cut.mergePrice) return this.inner.cut(cut, views, signal);
    const { cloud, degrees } = await this.reduce(cut, signal);
    return { errors: await this.sketch(cloud, views, signal), degrees: degreesOf(degrees) };
  }

  override async reduce(cut: Cut, signal?: AbortSignal): Promise<ReducedCloud> {
    const reduced = await this.inner.reduce(cut, signal);
    return cut.mergePrice ? applyMerges(reduced, this.#found, cut.mergePrice) : reduced;
  }

  get #found(): Merges {
    if (this.#merges === undefined) throw new Error('MergingEvaluator: rank() comes before all else');
    return this.#merges;
  }
}
