import type { GaussianCloud } from '@gaussian-splat/core';
import type { CutFigures, Evaluator, EvaluationViews } from './evaluator.js';
import type { SplatVisibility } from './pages/splat-visibility.js';
import type { Cut, ReducedCloud } from './reduce.js';
import type { Ranking } from './score.js';

/** An evaluator that behaves like another one. Subclasses override the methods that they change. */
export abstract class EvaluatorLayer implements Evaluator {
  protected readonly inner: Evaluator;

  /** @param inner Is destroyed with this one. */
  constructor(inner: Evaluator) {
    this.inner = inner;
  }

  get mergePrices(): readonly number[] | undefined {
    return this.inner.mergePrices;
  }

  rank(signal?: AbortSignal): Promise<Ranking> {
    return this.inner.rank(signal);
  }

  cut(cut: Cut, views: EvaluationViews, signal?: AbortSignal): Promise<CutFigures> {
    return this.inner.cut(cut, views, signal);
  }

  reduce(cut: Cut, signal?: AbortSignal): Promise<ReducedCloud> {
    return this.inner.reduce(cut, signal);
  }

  async seen(): Promise<SplatVisibility | undefined> {
    return this.inner.seen?.();
  }

  compare(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]> {
    return this.inner.compare(cloud, views, signal);
  }

  sketch(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]> {
    return this.inner.sketch(cloud, views, signal);
  }

  destroy(): void {
    this.inner.destroy();
  }
}
