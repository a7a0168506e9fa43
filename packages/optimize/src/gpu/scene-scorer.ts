import { eyeOf, type Camera } from '@gaussian-splat/core';
import type { Viewpoint } from '@gaussian-splat/renderer';
import {
  BUFFER_USAGE,
  cameraValues,
  GpuMemory,
  layouts as rendererLayouts,
  rareKernelOf,
  TEXTURE_USAGE,
  writeStruct,
  submitPass,
  uniformWith,
} from '@gaussian-splat/renderer/stages';
import { AuxiliaryOutputs, untilItHasRoom, readBack } from '@gaussian-splat/renderer/tools';
import { optimizeLower, optimizeMoments, optimizeScore, SCORE_GROUP } from '../generated/shaders.js';
import { MIN_LOOKS, PRIOR_VIEWS, UNSEEN_CONTRAST } from '../score.js';
import { layouts, NO_VIEW } from './layouts.js';
import type { SceneParts } from './scene-parts.js';
import { show } from './show.js';

/**
 * Assumed squared difference of a splat's color from the colors behind it, for each channel, peak 1. It is smaller than the
 * means of captured scenes (0.05 to 0.16). It affects only the first try, because the error of a cut is measured in
 * images.
 */
const USUAL_CONTRAST = 0.02;
/**
 * Number of views, evenly spaced, that are drawn before scoring. The renderer measures the time of a pair in the first,
 * second, fourth and eighth frame.
 */
const REHEARSED = 8;
const COUNTS_BYTES = 16;
const FLOAT_BYTES = 4;
const VIEW_STRIDE = 256 * Math.ceil(rendererLayouts.View.size / 256);

/**
 * Scores the splats of a scene in all views. The compute rasterizer records the maximum weight of each splat, and buffers
 * of {@link SceneParts} accumulate the results on the GPU. Only overflow counts are read back, at the end.
 */
export class SceneScorer {
  readonly #device: GPUDevice;
  readonly #viewpoint: Viewpoint;
  readonly #scene: SceneParts;
  readonly #views: readonly Camera[];
  readonly #memory: GpuMemory;
  /** Maximum weight of each splat in the current view, by slot. */
  readonly #peaks: GPUBuffer;
  readonly #counts: GPUBuffer;
  /** Eyes of the views, relative to the origin of the scene. */
  readonly #eyes: GPUBuffer;
  readonly #targets = new Map<string, GPUTexture>();

  /** @param viewpoint Viewpoint that draws the views. It must use the rasterizer `tiles`. */
  constructor(device: GPUDevice, viewpoint: Viewpoint, scene: SceneParts, views: readonly Camera[]) {
    this.#device = device;
    this.#viewpoint = viewpoint;
    this.#scene = scene;
    this.#views = views;
    this.#memory = new GpuMemory(device);
    const { storage, copySource, copyDestination } = BUFFER_USAGE;
    this.#peaks = this.#memory.buffer('gs.optimize.peaks', FLOAT_BYTES * scene.slots, storage | copyDestination);
    this.#counts = this.#memory.buffer('gs.optimize.counts', COUNTS_BYTES * views.length, copySource | copyDestination);
    this.#eyes = this.#memory.buffer('gs.optimize.eyes', 16 * views.length, storage, eyesOf(views, scene));
  }

  /** Scores all splats, and fits their colors at lower degrees. */
  async run(signal?: AbortSignal, onScored?: (views: number, all: number) => void): Promise<void> {
    await this.#rehearse(signal);
    await untilItHasRoom(() => this.#look(signal, onScored));
    this.#lower();
  }

  destroy(): void {
    this.#memory.destroy();
    for (const target of this.#targets.values()) target.destroy();
  }

  /**
   * Draws a few views, and waits for each. Afterwards the viewpoint has the capacity for all views. It has also measured
   * the time of pairs, so that it uses few submissions, because they take CPU time.
   */
  async #rehearse(signal: AbortSignal | undefined): Promise<void> {
    const step = Math.max(1, Math.floor(this.#views.length / REHEARSED));
    for (const camera of this.#views.filter((_, k) => k % step === 0).slice(0, REHEARSED)) {
      await untilItHasRoom(async () => {
        signal?.throwIfAborted();
        this.#paint(camera);
        const encoder = this.#device.createCommandEncoder({ label: 'gs.optimize.rehearse' });
        this.#viewpoint.copyCounts(encoder, this.#counts, 0);
        this.#device.queue.submit([encoder.finish()]);
        const [counts] = await readBack(this.#device, [{ buffer: this.#counts, byteLength: COUNTS_BYTES }]);
        return this.#viewpoint.hadRoom(new Uint32Array(counts));
      });
    }
  }

  /** Draws a view, and records the maximum weights of splats. */
  #paint(camera: Camera): void {
    const target = this.#targetOf(camera);
    const auxiliary = new AuxiliaryOutputs({ contributions: this.#peaks });
    show(this.#viewpoint, this.#scene.gaussians);
    this.#viewpoint.draw(camera, { target, auxiliary });
  }

  /**
   * Scores the splats in all views.
   * @returns Whether the capacity was sufficient for each view. If false, the next call has more.
   */
  async #look(signal: AbortSignal | undefined, onScored?: (views: number, all: number) => void): Promise<boolean> {
    const uniforms = this.#writeViews();
    const encoder = this.#device.createCommandEncoder({ label: 'gs.optimize.clear' });
    encoder.clearBuffer(this.#peaks);
    for (const { scores, moments } of this.#scene.parts) {
      encoder.clearBuffer(scores);
      encoder.clearBuffer(moments);
    }
    this.#device.queue.submit([encoder.finish()]);
    for (const [k, camera] of this.#views.entries()) {
      signal?.throwIfAborted();
      this.#paint(camera);
      this.#note(uniforms, k);
      const isLast = k === this.#views.length - 1;
      if (!isLast && (k + 1) % this.#scene.views !== 0) continue;
      this.#gather(k - (k % this.#scene.views), k + 1);
      // During this wait, the viewpoint can read its own counts back.
      await this.#device.queue.onSubmittedWorkDone();
      onScored?.(k + 1, this.#views.length);
    }
    const [counts] = await readBack(this.#device, [{ buffer: this.#counts }]);
    this.#memory.free(uniforms);
    signal?.throwIfAborted();
    const hadRoom = this.#views.map((_, k) => this.#viewpoint.hadRoom(new Uint32Array(counts, COUNTS_BYTES * k, 4)));
    return !hadRoom.includes(false);
  }

  /** Returns a buffer with a `View` for each view and part. */
  #writeViews(): GPUBuffer {
    const { parts, gaussians } = this.#scene;
    const bytes = new ArrayBuffer(VIEW_STRIDE * parts.length * this.#views.length);
    this.#views.forEach((camera, k) => {
      const values = {
        ...NO_VIEW,
        ...cameraValues(camera, gaussians.origin, gaussians.filterVariance),
        antialiased: +gaussians.antialiased,
      };
      parts.forEach(({ page }, p) => {
        const at = VIEW_STRIDE * (parts.length * k + p);
        writeStruct(rendererLayouts.View, { ...values, splat_count: page.count }, bytes, at);
      });
    });
    const { uniform, copyDestination } = BUFFER_USAGE;
    const buffer = this.#memory.buffer('gs.optimize.views', bytes.byteLength, uniform | copyDestination);
    this.#device.queue.writeBuffer(buffer, 0, bytes);
    return buffer;
  }

  /** Adds the results of view `k`, which has been drawn, to scores and energies. */
  #note(uniforms: GPUBuffer, k: number): void {
    const kernel = rareKernelOf(this.#device, optimizeScore);
    const encoder = this.#device.createCommandEncoder({ label: 'gs.optimize.score' });
    this.#viewpoint.copyCounts(encoder, this.#counts, COUNTS_BYTES * k);
    const { parts, views } = this.#scene;
    const record = (pass: GPUComputePassEncoder): void =>
      parts.forEach(({ page, first, row, scores, energies }, p) => {
        const offset = VIEW_STRIDE * (parts.length * k + p);
        const size = FLOAT_BYTES * row;
        const bindings = kernel.bind({
          view: { buffer: uniforms, offset, size: rendererLayouts.View.size },
          gaussians: page.geometry,
          peaks: { buffer: this.#peaks, offset: FLOAT_BYTES * first, size },
          energies: { buffer: energies, offset: size * (k % views), size },
          scores,
        });
        kernel.dispatch(pass, bindings, Math.ceil(page.count / SCORE_GROUP));
      });
    submitPass(this.#device, 'gs.optimize.score', record, encoder);
  }

  /** Adds the energies of views `first` to `end` to the moments of color. */
  #gather(first: number, end: number): void {
    const { shDegree } = this.#scene.gaussians;
    if (shDegree === 0) return;
    const kernel = rareKernelOf(this.#device, optimizeMoments);
    submitPass(this.#device, 'gs.optimize.moments', (pass) =>
      this.#scene.parts.forEach(({ page, row, energies, moments }) => {
        const counts = { splat_count: page.count, row, views: end - first, first_view: first, sh_degree: shDegree };
        const seen = uniformWith(this.#memory, 'gs.optimize.moments', layouts.MomentViews, counts);
        const bindings = kernel.bind({ seen, eyes: this.#eyes, gaussians: page.geometry, energies, moments });
        kernel.dispatch(pass, bindings, Math.ceil(page.count / SCORE_GROUP));
      }),
    );
  }

  /** Converts sums to scores and colors at lower degrees, in one submission for each part. */
  #lower(): void {
    const kernel = rareKernelOf(this.#device, optimizeLower);
    for (const { page, row, scores, moments, lowered } of this.#scene.parts) {
      const lowering = uniformWith(this.#memory, 'gs.optimize.lower', layouts.Lowering, {
        ...{ splat_count: page.count, row, views: this.#views.length, sh_degree: this.#scene.gaussians.shDegree },
        ...{ contrast: USUAL_CONTRAST + UNSEEN_CONTRAST, prior_views: PRIOR_VIEWS, min_looks: MIN_LOOKS },
      });
      const bindings = kernel.bind({ lowering, sh: page.sh, moments, scores, lowered });
      const groups = Math.ceil(page.count / SCORE_GROUP);
      submitPass(this.#device, 'gs.optimize.lower', (pass) => kernel.dispatch(pass, bindings, groups));
    }
  }

  #targetOf({ width, height }: Camera): GPUTexture {
    const key = `${width} x ${height}`;
    const known = this.#targets.get(key);
    if (known) return known;
    const { storageBinding, renderAttachment } = TEXTURE_USAGE;
    const usage = storageBinding | renderAttachment;
    const made = this.#device.createTexture({
      label: 'gs.optimize.view',
      size: [width, height],
      format: 'rgba16float',
      usage,
    });
    this.#targets.set(key, made);
    return made;
  }
}

/** Returns the eyes of views relative to the scene's origin, float32 [views, 4]. The fourth number is padding. */
function eyesOf(views: readonly Camera[], { gaussians }: SceneParts): Uint32Array {
  const places = views.flatMap(({ worldToCamera }) => [
    ...eyeOf(worldToCamera).map((value, axis) => value - gaussians.origin[axis]),
    1,
  ]);
  return new Uint32Array(Float32Array.from(places).buffer);
}
