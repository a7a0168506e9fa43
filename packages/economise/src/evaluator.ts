import type { GaussianCloud } from '@gaussian-splat/core';
import type { SplatVisibility } from './pages/seen-splats.js';
import type { Cut, ReducedCloud } from './reduce.js';
import type { Ranking } from './score.js';

/**
 * Views for measuring errors: those of the search, or the held-out ones, which measure the result and whether its cut
 * is too large.
 */
export type EvaluationViews = 'searched' | 'heldOut';

/** Statistics and errors of a cut scene. */
export interface CutFigures {
  /**
   * Mean squared error of the colors of each image, peak 1, over the pixels that the whole scene covers; views without
   * any are excluded.
   */
  readonly errors: readonly number[];
  /** [4] number of remaining splats by the degree of spherical harmonics that they keep. */
  readonly degrees: readonly number[];
}

/**
 * Evaluates a scene: the contribution of its splats, and the error of images of a reduced scene against those of the
 * whole. {@link GpuEvaluator} does it on the GPU.
 */
export interface Evaluator {
  /** Scores the scene in the scoring views. Must be called first; it draws the scene once. */
  rank(signal?: AbortSignal): Promise<Ranking>;
  /** Visibility of the splats in the scoring views, if the evaluator provides it; call {@link rank} first. */
  seen?(): Promise<SplatVisibility | undefined>;
  /** Measures a cut in images of the scene. */
  cut(cut: Cut, views: EvaluationViews, signal?: AbortSignal): Promise<CutFigures>;
  /** Applies a cut, for writing. */
  reduce(cut: Cut, signal?: AbortSignal): Promise<ReducedCloud>;
  /** Errors of another cloud that replaces the scene, as {@link CutFigures.errors}. */
  compare(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]>;
  /** The same at the speed of {@link cut}: accurate enough for a search. */
  sketch(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]>;
  /**
   * Fits a cut scene to images of the whole one, if the evaluator supports it ({@link RefiningEvaluator}). The argument
   * is not modified.
   */
  refine?(reduced: ReducedCloud, signal?: AbortSignal): Promise<ReducedCloud>;
  /** Frees the resources of the evaluator. */
  destroy(): void;
  /** Measured prices of merges, in ascending order; undefined for an evaluator without merging. */
  readonly mergePrices?: readonly number[];
}
