import type { GaussianCloud } from '@gaussian-splat/core';
import type { Viewpoint } from '@gaussian-splat/renderer';
import { isOfPlanes, rareKernelOf } from '@gaussian-splat/renderer/stages';
import { readBack } from '@gaussian-splat/renderer/tools';
import type { SplatVisibility } from '../pages/splat-visibility.js';
import type { CutFigures, Evaluator, EvaluationViews } from '../evaluator.js';
import * as shaders from '../generated/shaders.js';
import { stayingInOrder } from '../order.js';
import { inline, poolFor, type TaskPool } from '../parts/task-pool.js';
import { reduceInParts, writtenOrder, type Cut, type ReducedCloud } from '../reduce.js';
import type { ReducedSh, Ranking, Scores } from '../score.js';
import type { ViewSplit } from '../views.js';
import { CloudBuffers } from './cloud-buffers.js';
import { CutScene } from './cut-scene.js';
import { layouts } from './layouts.js';
import { ImageErrors } from './image-errors.js';
import { putLowered } from './put-lowered.js';
import { SceneParts, loweredNumbers } from './scene-parts.js';
import { SceneScorer } from './scene-scorer.js';
import { exactViewpoint } from './show.js';
import { seenIn } from './splat-visibility.js';

export interface GpuEvaluatorOptions {
  /** Maximum number of splats of a binding, for tests. By default, only the limits of the device apply. */
  readonly partSplats?: number;
  /** Number of views whose energies are stored before they are added to the moments of color; default 32. */
  readonly viewsAtOnce?: number;
  /** Pool that extracts the remaining splats from the cloud in parallel; default {@link inline}. */
  readonly pool?: TaskPool;
  /** Called with the number of views that have been scored, and the number of all scoring views. */
  readonly onScored?: (views: number, all: number) => void;
}

/** Shaders whose pipelines are compiled once for each device. */
const STAGES = [
  ...[shaders.optimizeScore, shaders.optimizeMoments, shaders.optimizeLower, shaders.optimizeCut],
  ...[shaders.optimizeTake, shaders.imageError, shaders.imageErrorSum],
];

/** Default of `viewsAtOnce`, with which the size of energies is a fourth of the size of moments. */
const VIEWS_AT_ONCE = 32;

/**
 * Evaluator that scores and compares scenes on the GPU. The scene is uploaded and packed once. Cuts are applied to a copy
 * on the GPU, and only the errors of its images are read back. GPU memory for each splat of degree 3: 256 bytes for the
 * scene and its copy, and 872 bytes for scores and colors. Each pixel of the views that measure errors needs 16 bytes.
 */
export class GpuEvaluator implements Evaluator {
  readonly #device: GPUDevice;
  readonly #cloud: GaussianCloud;
  readonly #views: ViewSplit;
  readonly #scene: SceneParts;
  readonly #viewpoint: Viewpoint;
  readonly #cutScene: CutScene;
  readonly #pool: TaskPool;
  readonly #onScored: GpuEvaluatorOptions['onScored'];
  readonly #errors = new Map<EvaluationViews, ImageErrors>();
  #ranking: Ranking | undefined;
  /** Order of all splats by descending visibility, which a thread computes. Undefined without threads. */
  #order: Promise<Uint32Array> | undefined;
  /** Measured cuts by views and thresholds. A search for several targets measures many cuts again. */
  readonly #cuts = new Map<string, CutFigures>();

  private constructor(
    device: GPUDevice,
    cloud: GaussianCloud,
    views: ViewSplit,
    scene: SceneParts,
    cutScene: CutScene,
    pool: TaskPool,
    onScored: GpuEvaluatorOptions['onScored'],
  ) {
    this.#device = device;
    this.#cloud = cloud;
    this.#views = views;
    this.#scene = scene;
    this.#cutScene = cutScene;
    this.#pool = pool;
    this.#onScored = onScored;
    this.#viewpoint = exactViewpoint(device);
  }

  /** Starts the compilation of all pipelines, so that they are ready when the caller has a cloud. */
  static prepare(device: GPUDevice): void {
    for (const stage of STAGES) rareKernelOf(device, stage).prepare();
    exactViewpoint(device).destroy();
  }

  /**
   * Creates an evaluator, and uploads a cloud.
   * @param views Three disjoint sets of views. If scoring views do not show a part of the scene, other views must, because
   * the part would otherwise seem unimportant.
   * @throws GaussianSplatError `out-of-memory/*`
   */
  static async create(
    device: GPUDevice,
    cloud: GaussianCloud,
    views: ViewSplit,
    { partSplats, viewsAtOnce = VIEWS_AT_ONCE, pool = inline, onScored }: GpuEvaluatorOptions = {},
  ): Promise<GpuEvaluator> {
    const energies = Math.min(views.scored.length, viewsAtOnce);
    const scene = await SceneParts.upload(device, cloud, energies, partSplats);
    try {
      return new GpuEvaluator(device, cloud, views, scene, await CutScene.of(device, scene), pool, onScored);
    } catch (error) {
      scene.destroy();
      throw error;
    }
  }

  async rank(signal?: AbortSignal): Promise<Ranking> {
    signal?.throwIfAborted();
    if (this.#ranking) return this.#ranking;
    const scorer = new SceneScorer(this.#device, this.#viewpoint, this.#scene, this.#views.scored);
    try {
      await scorer.run(signal, this.#onScored);
      const parts = this.#scene.parts.map(({ scores, page }) => ({
        buffer: scores,
        byteLength: layouts.Score.size * page.count,
      }));
      this.#ranking = this.#rankingOf(await readBack(this.#device, parts));
      this.#order = this.#orderAhead(this.#ranking);
      // Reference images are drawn at once, because the viewpoint has the capacity for this scene.
      for (const views of ['searched', 'heldOut'] as const) await this.#errorsIn(views);
      return this.#ranking;
    } finally {
      scorer.destroy();
    }
  }

  /**
   * Returns the energy of each splat in a scoring view, [N]: the sum of its squared weights over the pixels of the image,
   * estimated from its maximum weight and its size.
   * @param view Index of one of the last `viewsAtOnce` scoring views.
   */
  async energiesIn(view: number): Promise<Float32Array> {
    const parts = this.#scene.parts.map(({ energies, row, page }) => ({
      buffer: energies,
      byteOffset: 4 * row * (view % this.#scene.views),
      byteLength: 4 * page.count,
    }));
    const found = new Float32Array(this.#cloud.count);
    let slot = 0;
    for (const bytes of await readBack(this.#device, parts)) {
      found.set(new Float32Array(bytes), slot);
      slot += bytes.byteLength / 4;
    }
    return found;
  }

  /** Returns the visibility of the splats in the scoring views, which determines their quantization. */
  async seen(): Promise<SplatVisibility> {
    if (this.#ranking === undefined) throw new Error('GpuEvaluator: rank() comes before seen()');
    return seenIn(this.#device, this.#scene, this.#views.scored.length);
  }

  async scores(): Promise<Scores> {
    if (this.#ranking === undefined) throw new Error('GpuEvaluator: rank() comes before scores()');
    const stride = loweredNumbers(this.#cloud.shDegree);
    if (stride === 0) return { ...this.#ranking, lowered: [] };
    const parts = this.#scene.parts.map(({ lowered, page }) => ({
      buffer: lowered,
      byteLength: 4 * stride * page.count,
    }));
    const records = await readBack(this.#device, parts);
    return { ...this.#ranking, lowered: this.#loweredOf(records.map((bytes) => new Float32Array(bytes))) };
  }

  async cut(cut: Cut, views: EvaluationViews, signal?: AbortSignal): Promise<CutFigures> {
    signal?.throwIfAborted();
    const key = JSON.stringify([views, cut]);
    const known = this.#cuts.get(key);
    if (known) return known;
    const errors = await this.#errorsIn(views);
    signal?.throwIfAborted();
    this.#cutScene.apply(cut);
    const [found, degrees] = await Promise.all([errors.measure(this.#cutScene), this.#cutScene.degrees()]);
    const figures = { errors: found, degrees };
    this.#cuts.set(key, figures);
    return figures;
  }

  async reduce(cut: Cut, signal?: AbortSignal): Promise<ReducedCloud> {
    if (this.#ranking === undefined) throw new Error('GpuEvaluator: rank() comes before reduce()');
    signal?.throwIfAborted();
    this.#cutScene.apply(cut);
    const { staying, degrees: all } = await this.#cutScene.choice();
    const order = await this.#order;
    const kept = order
      ? stayingInOrder(order, staying)
      : writtenOrder(this.#cloud, this.#ranking.contribution, staying);
    const degrees = new Uint8Array(kept.length);
    for (let k = 0; k < kept.length; k++) degrees[k] = all[kept[k]];
    const reduced = await reduceInParts(this.#cloud, { kept, degrees }, this.#pool);
    await putLowered(this.#device, this.#scene, reduced, kept, this.#pool);
    return reduced;
  }

  async compare(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]> {
    const errors = await this.#errorsIn(views);
    signal?.throwIfAborted();
    const gaussians = await CloudBuffers.upload(this.#device, cloud);
    try {
      return await errors.measure(gaussians);
    } finally {
      gaussians.destroy();
    }
  }

  sketch(cloud: GaussianCloud, views: EvaluationViews, signal?: AbortSignal): Promise<readonly number[]> {
    return this.compare(cloud, views, signal);
  }

  destroy(): void {
    for (const errors of this.#errors.values()) errors.destroy();
    this.#viewpoint.destroy();
    this.#cutScene.destroy();
    this.#scene.destroy();
  }

  async #errorsIn(views: EvaluationViews): Promise<ImageErrors> {
    const known = this.#errors.get(views);
    if (known) return known;
    const made = await ImageErrors.of(this.#device, this.#viewpoint, this.#scene.gaussians, this.#views[views]);
    this.#errors.set(views, made);
    return made;
  }

  #orderAhead({ contribution }: Ranking): Promise<Uint32Array> | undefined {
    const { count, scales, positions } = this.#cloud;
    const pool = poolFor(this.#pool, count, [scales]);
    if (pool === inline || isOfPlanes(positions)) return undefined;
    const order = pool.run('orderAll', [{ scales, contribution }]).then(([all]) => all);
    // The caller that awaits `order` receives its error; this handler prevents an unhandled rejection.
    order.catch(() => undefined);
    return order;
  }

  /** Converts the scores of all parts to a ranking. */
  #rankingOf(parts: readonly ArrayBuffer[]): Ranking {
    const stride = layouts.Score.size / 4;
    const { contribution: at, removal } = layouts.Score.fields;
    const contribution = new Float32Array(this.#cloud.count);
    const removalError = new Float32Array(this.#cloud.count);
    let i = 0;
    for (const scores of parts.map((bytes) => new Float32Array(bytes))) {
      for (let k = 0; k < scores.length; k += stride, i++) {
        const error = scores[k + removal.offset / 4];
        contribution[i] = scores[k + at.offset / 4];
        removalError[i] = judged(error);
      }
    }
    return { contribution, removalError };
  }

  #loweredOf(parts: readonly Float32Array[]): ReducedSh[] {
    const { count, shDegree } = this.#cloud;
    const stride = loweredNumbers(shDegree);
    const partSplats = parts[0].length / stride;
    const partOf = (i: number): Float32Array => parts[Math.floor(i / partSplats)];
    return Array.from({ length: shDegree }, (_, degree) => {
      const [first, end] = [loweredNumbers(shDegree, degree), loweredNumbers(shDegree, degree + 1)];
      const error = new Float32Array(count);
      for (let i = 0; i < count; i++) error[i] = judged(partOf(i)[stride * (i % partSplats) + degree]);
      const of = (i: number): Float32Array => {
        const at = stride * (i % partSplats);
        return partOf(i).subarray(at + first, at + end);
      };
      return { error, of };
    });
  }
}

/** Returns Infinity for UNJUDGED, its substitute in WGSL; otherwise the error. */
const judged = (error: number): number => (error >= shaders.UNJUDGED ? Infinity : error);
