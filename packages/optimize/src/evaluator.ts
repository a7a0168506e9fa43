import type { GaussianCloud } from '@gaussian-splat/core';
import type { SplatVisibility } from './pages/splat-visibility.js';
import type { Cut, ReducedCloud } from './reduce.js';
import type { Ranking } from './score.js';

/**
 * Views for measurements of errors. `searched` views find the size of the cut. `heldOut` views measure the result, and
 * whether its cut is too large.
 */
export type EvaluationViews = 'searched' | 'heldOut';

/** Errors and sizes of a cut scene. */
export interface CutFigures {
  /**
   * Mean squared error of the colors of each view's image, peak 1, over the pixels that the whole scene covers. Views
   * that the scene does not cover are excluded.
   */
  readonly errors: readonly number[];
  /** [4] number of remaining splats of each degree of spherical harmonics, 0 to 3. */
  readonly degrees: readonly number[];
}

/**
 * Evaluator of a scene: measures the contribution of its splats, and the error of images of a reduced scene against those
 * of the whole scene. {@link GpuEvaluator} does so on the GPU.
 */
export interface Evaluator {
  /** Scores the splats in the scoring views. Call it before other methods. */
  rank(signal?: AbortSignal): Promise<Ranking>;
  /** Returns the visibility of the splats in the scoring views, if the evaluator measures it. */
  seen?(): Promise<SplatVisibility | undefined>;
  /** Measures the errors of the scene after a cut. */
  cut(cut: Cut, views: EvaluationViews, signal?: AbortSignal): Promise<CutFigures>;
  /** Returns the scene after a cut, for writing. The scene is not modified. */
  reduce(cut: Cut, signal?: AbortSignal): Promise<ReducedCloud>;
  /** Measures the errors of a cloud that replaces the scene, as {@link CutFigures.errors}. */
  compare(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]>;
  /** Measures the same errors as {@link compare} in the time of {@link cut}, accurately enough for a search. */
  sketch(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]>;
  /**
   * Returns a cut scene after fitting it to images of the whole scene. Only {@link RefiningEvaluator} supports this. The
   * argument is not modified.
   */
  refine?(reduced: ReducedCloud, signal?: AbortSignal): Promise<ReducedCloud>;
  /** Frees the resources of the evaluator. */
  destroy(): void;
  /** Values of `Cut.mergePrice` to measure, in ascending order. Undefined for an evaluator without merging. */
  readonly mergePrices?: readonly number[];
}
