import { GaussianSplatError, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import type { Viewpoint } from '@gaussian-splat/renderer';
import type { Evaluator } from '../evaluator.js';
import { EvaluatorLayer } from '../evaluator-layer.js';
import { CloudBuffers } from '../gpu/cloud-buffers.js';
import { ImageErrors } from '../gpu/image-errors.js';
import { exactViewpoint } from '../gpu/show.js';
import { mean } from '../measure.js';
import type { ReducedCloud } from '../reduce.js';
import { RefinedScene } from './refined-scene.js';
import { SceneFitter, USUAL_DESCENT, type OptimizerOptions } from './scene-fitter.js';
import { LEFT_BY_REFINING } from './search-refined.js';

export interface RefiningOptions {
  /** Draws the reference images, and runs the backward passes. */
  readonly device: GPUDevice;
  /** Views that the splats are fitted to: the scoring views. None of them may be a search or held-out view. */
  readonly views: readonly Camera[];
  /** Options of the optimizer; defaults: {@link USUAL_DESCENT}. */
  readonly descent?: Partial<OptimizerOptions>;
}

/**
 * An evaluator that refines the cuts of another evaluator. Gradient descent through the rasterizer fits the remaining
 * splats to images of the whole scene. On the GPU the images take 16 bytes for each pixel of the views. During the fit a
 * splat takes 1.2 kB at degree 3.
 */
export class RefiningEvaluator extends EvaluatorLayer {
  /**
   * Assumed fraction of the error of drops and merges that remains after refinement. `MergingOptions.maxError` must be
   * larger by the inverse of this fraction.
   */
  static readonly leftByRefining = LEFT_BY_REFINING;
  readonly #cloud: GaussianCloud;
  readonly #options: RefiningOptions;
  readonly #viewpoint: Viewpoint;
  #images: Promise<ImageErrors> | undefined;

  /**
   * @param inner Evaluator of the cuts; {@link destroy} destroys it, too.
   * @param cloud The cloud that `inner` evaluates.
   * @throws GaussianSplatError `unsupported/no-webgpu` without a device; `argument/value` without a view
   */
  constructor(inner: Evaluator, cloud: GaussianCloud, options: RefiningOptions) {
    requireMeans(options);
    super(inner);
    this.#cloud = cloud;
    this.#options = options;
    this.#viewpoint = exactViewpoint(options.device);
  }

  async refine(reduced: ReducedCloud, signal?: AbortSignal): Promise<ReducedCloud> {
    const { device, descent } = this.#options;
    const images = await (this.#images ??= this.#draw());
    signal?.throwIfAborted();
    // No view shows a splat, so there is no image to fit.
    if (images.covered.every((pixels) => pixels === 0)) return reduced;
    const scene = await RefinedScene.of(device, reduced);
    try {
      const fitter = new SceneFitter(device, this.#viewpoint, scene, images);
      try {
        const before = await fitter.fit({ ...USUAL_DESCENT, ...descent }, signal);
        // Too few or too large steps may increase the error: then the cut remains as it was.
        if (mean(await images.measure(scene)) >= mean(before)) return reduced;
      } finally {
        fitter.destroy();
      }
      return { ...reduced, cloud: await scene.read() };
    } finally {
      scene.destroy();
    }
  }

  override destroy(): void {
    super.destroy();
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
      remedy: 'request one from an adapter (SwiftShader works, slowly), or do not refine',
    });
  if (!views || views.length === 0)
    throw new GaussianSplatError('argument/value', {
      where: 'RefiningOptions.views',
      expected: 'one view or more',
      found: 'none',
      remedy: 'pass the scoring views',
    });
}
