import type { GaussianCloud } from '@gaussian-splat/core';
import type { SeenSplats } from './pages/seen-splats.js';
import type { Cut, ReducedCloud } from './reduce.js';
import type { Ranking } from './score.js';

/** Views that errors are measured in: those of the search, or those that are held out: the result is measured in them, and that its cut is not too large. */
export type JudgedViews = 'searched' | 'heldOut';

/** What a cut leaves of a scene, and what that costs. */
export interface CutFigures {
  /** Mean squared error of the colours of each image, peak 1, over the pixels that the whole scene covers; views that show nothing of it are left out. */
  readonly errors: readonly number[];
  /** [4] splats that stay, by the degree of spherical harmonics that they keep. */
  readonly degrees: readonly number[];
}

/**
 * Looks at a scene: says what its splats contribute, and how far images of what is left of it are from those of the whole. {@link GpuEvaluator} does it on the GPU.
 */
export interface Evaluator {
  /** Looks at the scene in the scored views. To be called before all else; it draws the scene once. */
  rank(signal?: AbortSignal): Promise<Ranking>;
  /** How the scored views see the splats, by evaluators that tell; {@link rank} comes before it. */
  seen?(): Promise<SeenSplats | undefined>;
  /** Figures of a cut, in images of the scene. */
  cut(cut: Cut, views: JudgedViews, signal?: AbortSignal): Promise<CutFigures>;
  /** What a cut leaves, to be written. */
  reduce(cut: Cut, signal?: AbortSignal): Promise<ReducedCloud>;
  /** Errors of another cloud in place of the scene, as {@link CutFigures.errors}. */
  compare(cloud: GaussianCloud, views: JudgedViews, signal?: AbortSignal): Promise<readonly number[]>;
  /** The same, as quickly as {@link cut} finds errors: near enough for a search. */
  sketch(cloud: GaussianCloud, views: JudgedViews, signal?: AbortSignal): Promise<readonly number[]>;
  /** Fits what a cut left to images of the scene, by evaluators that do ({@link RefiningEvaluator}). What it is given is left as it is. */
  refine?(reduced: ReducedCloud, signal?: AbortSignal): Promise<ReducedCloud>;
  /** Frees what the evaluator holds. */
  destroy(): void;
  /** Prices at which merges are measured, the lowest first; undefined for an evaluator that merges nothing. */
  readonly mergePrices?: readonly number[];
}
