import { GaussianSplatError, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import type { Viewpoint } from '@gaussian-splat/renderer';
import type { SplatVisibility } from '../pages/seen-splats.js';
import type { CutFigures, Evaluator, EvaluationViews } from '../evaluator.js';
import { CloudBuffers } from '../gpu/cloud-buffers.js';
import { ImageErrors } from '../gpu/image-errors.js';
import { exactViewpoint } from '../gpu/show.js';
import { mean } from '../measure.js';
import type { Cut, ReducedCloud } from '../reduce.js';
import type { Ranking } from '../score.js';
import { RefinedScene } from './refined-scene.js';
import { SceneFitter, USUAL_DESCENT, type OptimizerOptions } from './scene-fitter.js';
import { LEFT_BY_REFINING } from './search-refined.js';

export interface RefiningOptions {
  /** Draws the reference images, and runs the backward passes. */
  readonly device: GPUDevice;
  /** Views of these images: the scoring views. None of them may be a search or held-out view. */
  readonly views: readonly Camera[];
  /** Optimizer options; missing ones have defaults. */
  readonly descent?: Partial<OptimizerOptions>;
}

/**
 * An evaluator that refines the cuts of another one: the remaining splats are fitted to images of the whole scene, by
 * gradient descent through the rasterizer. The images stay on the GPU: 16 bytes for each pixel of the views. A splat
 * takes 1.2 kB there at degree 3 during the fit.
 */
export class RefiningEvaluator implements Evaluator {
  /**
   * Assumed fraction of the error of drops and merges after refinement: merges must be found up to a correspondingly
   * higher error (`MergingOptions.maxError`).
   */
  static readonly leftByRefining = LEFT_BY_REFINING;
  readonly #inner: Evaluator;
  readonly #cloud: GaussianCloud;
  readonly #options: RefiningOptions;
  readonly #viewpoint: Viewpoint;
  #images: Promise<ImageErrors> | undefined;

  /**
   * @param inner Is destroyed with this one.
   * @param cloud The cloud that `inner` evaluates.
   * @throws GaussianSplatError `unsupported/no-webgpu` without a device; `argument/value` without a view
   */
  constructor(inner: Evaluator, cloud: GaussianCloud, options: RefiningOptions) {
    requireMeans(options);
    this.#inner = inner;
    this.#cloud = cloud;
    this.#options = options;
    this.#viewpoint = exactViewpoint(options.device);
  }

  get mergePrices(): readonly number[] | undefined {
    return this.#inner.mergePrices;
  }

  rank(signal?: AbortSignal): Promise<Ranking> {
    return this.#inner.rank(signal);
  }

  cut(cut: Cut, views: EvaluationViews, signal?: AbortSignal): Promise<CutFigures> {
    return this.#inner.cut(cut, views, signal);
  }

  reduce(cut: Cut, signal?: AbortSignal): Promise<ReducedCloud> {
    return this.#inner.reduce(cut, signal);
  }

  async seen(): Promise<SplatVisibility | undefined> {
    return this.#inner.seen?.();
  }

  compare(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]> {
    return this.#inner.compare(cloud, views, signal);
  }

  sketch(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]> {
    return this.#inner.sketch(cloud, views, signal);
  }

  async refine(reduced: ReducedCloud, signal?: AbortSignal): Promise<ReducedCloud> {
    const { device, descent } = this.#options;
    const images = await (this.#images ??= this.#draw());
    signal?.throwIfAborted();
    // There is no reference to fit.
    if (images.covered.every((pixels) => pixels === 0)) return reduced;
    const scene = await RefinedScene.of(device, reduced);
    try {
      const fitter = new SceneFitter(device, this.#viewpoint, scene, images);
      try {
        const before = await fitter.fit({ ...USUAL_DESCENT, ...descent }, signal);
        // Too few or too large steps may increase the error.
        if (mean(await images.measure(scene)) >= mean(before)) return reduced;
      } finally {
        fitter.destroy();
      }
      return { ...reduced, cloud: await scene.read() };
    } finally {
      scene.destroy();
    }
  }

  destroy(): void {
    this.#inner.destroy();
    this.#viewpoint.destroy();
    void this.#images?.then(
      (images) => images.destroy(),
      () => undefined,
    );
  }

  async #draw(): Promise<ImageErrors> {
    const { device, views } = this.#options;
    const whole = await CloudBuffers.upload(device, this.#cloud);
    try {
      return await ImageErrors.of(device, this.#viewpoint, whole, views);
    } finally {
      whole.destroy();
    }
  }
}

function requireMeans({ device, views }: Partial<RefiningOptions>): void {
  if (device === undefined)
    throw new GaussianSplatError('unsupported/no-webgpu', {
      where: 'RefiningOptions.device',
      expected: 'a GPUDevice: splats are fitted by compute shaders',
      found: 'none',
      remedy: 'ask an adapter for one (SwiftShader’s will do, slowly), or do without refining',
    });
  if (!views || views.length === 0)
    throw new GaussianSplatError('argument/value', {
      where: 'RefiningOptions.views',
      expected: 'one view or more',
      found: 'none',
      remedy: 'give the views that splats are scored in',
    });
}
