import { shCoefficientCount } from '@gaussian-splat/core';
import type { Viewpoint } from '@gaussian-splat/renderer';
import {
  BUFFER_USAGE,
  cameraValues,
  BufferOwner,
  GpuMemory,
  layouts as rendererLayouts,
  rareKernelOf,
  writeStruct,
  submitPass,
  writeUniform,
} from '@gaussian-splat/renderer/stages';
import { AuxiliaryOutputs } from '@gaussian-splat/renderer/tools';
import {
  PATCH,
  REFINE_GROUP,
  refineBackward,
  refineChain,
  refineStep,
  SCREEN_BYTES,
  SCREEN_NUMBERS,
} from '../generated/shaders.js';
import { layouts, NO_VIEW } from '../gpu/layouts.js';
import type { ImageErrors } from '../gpu/image-errors.js';
import { show } from '../gpu/show.js';
import { mean } from '../measure.js';
import type { RefinedScene } from './refined-scene.js';

/** Auxiliary outputs without targets: the fitter needs only the rasterization inputs of a frame. */
const AUXILIARY = new AuxiliaryOutputs();
/** Bytes between the uniforms of two views: WebGPU aligns the offsets of bindings to 256 bytes. */
const VIEW_STRIDE = 256 * Math.ceil(rendererLayouts.View.size / 256);
const SMALL_STRIDE = 256;
/**
 * Mean squared error, 51 dB, for which the learning rates are tuned. If the initial error is smaller, the rates are
 * multiplied by the square root of the ratio.
 */
const USUAL_ERROR = 10 ** -5.1;
/** Number of views after which the CPU waits for the GPU. */
const AHEAD = 16;

/** Initial learning rates of Adam for each kind of parameter. */
export interface Rates {
  /** Learning rate of positions, in sizes of the splat along its own axes. Large or near splats do not move. */
  readonly position: number;
  /** Learning rate of log scales. */
  readonly growth: number;
  /** Learning rate of rotations, in radians about the splat's own axes. */
  readonly turn: number;
  /** Learning rate of the logits of opacities. */
  readonly logit: number;
  /** Learning rate of the coefficients of degree 0. */
  readonly constant: number;
  /** Learning rate of the coefficients of degrees 1 to 3. */
  readonly harmonic: number;
}

/** Options of the optimizer. */
export interface OptimizerOptions {
  /** Number of steps of Adam. */
  readonly steps: number;
  /** Number of views whose derivatives are summed in each step. */
  readonly viewsAtOnce: number;
  readonly rates: Rates;
  /** Final fraction of the rates, which decay exponentially. */
  readonly lastRate: number;
  /** Decay factor of Adam's running mean of derivatives, 0..1. */
  readonly keepMean: number;
  /** Decay factor of Adam's running mean of squared derivatives, 0..1. */
  readonly keepSquare: number;
  /**
   * Epsilon of Adam. Derivatives far below this value barely change a parameter. A derivative is that of the squared
   * error, summed over the pixels of an image.
   */
  readonly epsilon: number;
  /**
   * Maximum step, as a fraction of Newton's step along one parameter with the largest curvature in any view. Adam alone
   * takes steps of the same length for small derivatives. Such steps would move a splat arbitrarily if it fills one view
   * and is barely visible in the others.
   */
  readonly newton: number;
}

export const USUAL_DESCENT: OptimizerOptions = {
  ...{ steps: 2592, viewsAtOnce: 1, lastRate: 0.03, keepMean: 0.9, keepSquare: 0.99, epsilon: 1e-8, newton: 0.3 },
  rates: { position: 0.003, growth: 0.003, turn: 0.003, logit: 0.02, constant: 0.005, harmonic: 0.001 },
};

/** Fits the splats of a scene to images by gradient descent. */
export class SceneFitter extends BufferOwner {
  readonly #device: GPUDevice;
  readonly #viewpoint: Viewpoint;
  readonly #scene: RefinedScene;
  readonly #errors: ImageErrors;
  readonly #views: GPUBuffer;
  readonly #refineViews: GPUBuffer;
  readonly #steps: readonly GPUBuffer[];

  /** @param errors Holds the reference images and their views. */
  constructor(device: GPUDevice, viewpoint: Viewpoint, scene: RefinedScene, errors: ImageErrors) {
    super(new GpuMemory(device));
    this.#device = device;
    this.#viewpoint = viewpoint;
    this.#scene = scene;
    this.#errors = errors;
    const { uniform, copyDestination } = BUFFER_USAGE;
    [this.#views, this.#refineViews] = this.#writeViews();
    this.#steps = scene.parts.map(() =>
      this.memory.buffer('gs.refine.step', layouts.RefineStep.size, uniform | copyDestination),
    );
  }

  /**
   * Runs the optimizer steps.
   * @returns Mean squared errors before the first step: one for each view that shows splats.
   * @throws The signal's reason.
   */
  async fit(descent: OptimizerOptions, signal?: AbortSignal): Promise<readonly number[]> {
    const { steps, viewsAtOnce, lastRate } = descent;
    // Draws all views until the scene fits the viewpoint's capacity, because missing splats give wrong derivatives.
    const before = await this.#errors.measure(this.#scene);
    const rateScale = Math.min(1, Math.sqrt(mean(before) / USUAL_ERROR));
    const order = viewOrder(this.#errors.exhibits.length);
    await this.#survey(signal);
    let looks = 0;
    for (let step = 0; step < steps; step++) {
      for (let k = 0; k < viewsAtOnce; k++, looks++) {
        signal?.throwIfAborted();
        this.look(order[looks % order.length]);
        if (looks % AHEAD === AHEAD - 1) await this.#device.queue.onSubmittedWorkDone();
      }
      this.#step(step + 1, rateScale * lastRate ** (step / steps), descent);
    }
    await this.#device.queue.onSubmittedWorkDone();
    return before;
  }

  /** Draws a view, and adds the derivatives of its error to the gradients of the scene. @param view Index of the view. */
  look(view: number): void {
    const { camera, reference } = this.#errors.exhibits[view];
    const image = this.#errors.targetOf(camera);
    show(this.#viewpoint, this.#scene);
    this.#viewpoint.draw(camera, { target: image, auxiliary: AUXILIARY });
    const auxiliary = this.#viewpoint.auxiliary;
    if (auxiliary === undefined) return;
    const encoder = this.#device.createCommandEncoder({ label: 'gs.refine.look' });
    const pass = encoder.beginComputePass({ label: 'gs.refine.look' });
    const backward = rareKernelOf(this.#device, refineBackward);
    const { view: tiles, splats, pairs, tile_bits, ranges, survivors } = auxiliary;
    const painted = { view: tiles, splats, pairs, tile_bits, ranges, survivors };
    const images = { image: image.createView(), reference: reference.createView() };
    const bindings = backward.bind({ ...painted, ...images, screen: this.#scene.screen });
    backward.dispatchGrid(pass, bindings, Math.ceil(camera.width / PATCH), Math.ceil(camera.height / PATCH));
    const chain = rareKernelOf(this.#device, refineChain);
    this.#scene.parts.forEach(({ page, first, row, numbers, degrees, gradients, bends }, p) => {
      const place = this.#scene.parts.length * view + p;
      const bytes = SCREEN_BYTES * SCREEN_NUMBERS;
      const bound = chain.bind({
        view: { buffer: this.#views, offset: VIEW_STRIDE * place, size: rendererLayouts.View.size },
        refine_view: { buffer: this.#refineViews, offset: SMALL_STRIDE * place, size: layouts.RefineView.size },
        ...{ numbers, degrees, gradients, bends },
        screen: { buffer: this.#scene.screen, offset: bytes * first, size: bytes * row },
      });
      chain.dispatch(pass, bound, Math.ceil(page.count / REFINE_GROUP));
    });
    pass.end();
    this.#device.queue.submit([encoder.finish()]);
  }

  /** Measures the curvatures in all views before the first step, and discards the gradients. */
  async #survey(signal: AbortSignal | undefined): Promise<void> {
    for (let view = 0; view < this.#errors.exhibits.length; view++) {
      signal?.throwIfAborted();
      this.look(view);
      if (view % AHEAD === AHEAD - 1) await this.#device.queue.onSubmittedWorkDone();
    }
    const encoder = this.#device.createCommandEncoder({ label: 'gs.refine.survey' });
    for (const { gradients } of this.#scene.parts) encoder.clearBuffer(gradients);
    this.#device.queue.submit([encoder.finish()]);
  }

  /**
   * Runs one step of Adam, and packs the changed splats.
   * @param number Number of the step, from 1 on.
   * @param share Factor of all learning rates, 0..1.
   */
  #step(number: number, share: number, { rates, keepMean, keepSquare, epsilon, newton }: OptimizerOptions): void {
    const kernel = rareKernelOf(this.#device, refineStep);
    submitPass(this.#device, 'gs.refine.step', (pass) => {
      this.#scene.parts.forEach(({ page, row, numbers, degrees, gradients, means, bends }, p) => {
        writeUniform(this.#device, this.#steps[p], layouts.RefineStep, {
          ...{ splat_count: page.count, row, harmonics: 3 * shCoefficientCount(this.#scene.shDegree) },
          ...{ keep_mean: keepMean, keep_square: keepSquare, epsilon, newton },
          mean_scale: 1 / (1 - keepMean ** number),
          square_scale: 1 / (1 - keepSquare ** number),
          ...{ position_rate: share * rates.position, growth_rate: share * rates.growth },
          ...{ turn_rate: share * rates.turn, logit_rate: share * rates.logit },
          ...{ constant_rate: share * rates.constant, harmonic_rate: share * rates.harmonic },
        });
        const bindings = kernel.bind({ step: this.#steps[p], numbers, degrees, gradients, means, bends });
        kernel.dispatch(pass, bindings, Math.ceil(page.count / REFINE_GROUP));
      });
      this.#scene.pack(pass);
    });
  }

  /** Returns two buffers: the uniforms `View`, and the uniforms `RefineView`, of each view and part. */
  #writeViews(): [GPUBuffer, GPUBuffer] {
    const { parts, origin, antialiased, filterVariance, shDegree } = this.#scene;
    const { exhibits, covered } = this.#errors;
    const places = parts.length * exhibits.length;
    const [views, small] = [VIEW_STRIDE, SMALL_STRIDE].map((stride) => new ArrayBuffer(stride * places));
    exhibits.forEach(({ camera }, k) => {
      const values = {
        ...{ ...NO_VIEW, ...cameraValues(camera, origin, filterVariance) },
        ...{ antialiased: +antialiased, sh_degree: shDegree },
      };
      const weight = covered[k] > 0 ? (camera.width * camera.height) / covered[k] : 0;
      parts.forEach(({ page, row }, p) => {
        const place = parts.length * k + p;
        writeStruct(rendererLayouts.View, { ...values, splat_count: page.count }, views, VIEW_STRIDE * place);
        writeStruct(layouts.RefineView, { row, weight }, small, SMALL_STRIDE * place);
      });
    });
    const { uniform } = BUFFER_USAGE;
    return [views, small].map((bytes) =>
      this.memory.buffer('gs.refine.views', bytes.byteLength, uniform, new Uint32Array(bytes)),
    ) as [GPUBuffer, GPUBuffer];
  }
}

/** Returns the indices of all views, ordered so that consecutive views are far apart in the original list. */
function viewOrder(count: number): number[] {
  const gcd = (a: number, b: number): number => (b === 0 ? a : gcd(b, a % b));
  let step = Math.max(1, Math.round(0.618 * count));
  while (gcd(step, count) !== 1) step++;
  return Array.from({ length: count }, (_, k) => (k * step) % count);
}
