import { loadModule, validateCamera, type Camera } from '@gaussian-splat/core';
import { AccumulationTexture } from './accumulation.js';
import { makeStages, type Stages } from './bindings.js';
import type { ProbeAnswer, ProbePoint } from './depth-probe.js';
import { recordProjection } from './frame.js';
import type { FrameRequest, RendererOptions } from './frame-request.js';
import { FrameResources } from './frame-resources.js';
import type { GaussianScene } from './gaussian-scene.js';
import { layouts } from './generated/shaders.js';
import { BUFFER_USAGE, TEXTURE_USAGE } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';
import { writeStruct } from './gpu/struct.js';
import { leversOf, leversOfFrame, requireInRange, type FrameLevers, type Levers } from './levers.js';
import { makeRasterizer } from './rasterizers/make-rasterizer.js';
import type { NotedFrame, Painting, Rasterizer, RasterizerName, Surface } from './rasterizers/rasterizer.js';
import { missingFormat, requireNotes, requireRequest, requireTarget, requireTextureSize } from './requirements.js';
import type { Scratch } from './scratch.js';
import { ComposeStage, type ComposeBindings } from './stages/compose.js';
import { SubmissionPacer, type SubmissionWatch } from './submission-pacer.js';
import { copyCounts, readStatistics, type FrameStatistics } from './statistics.js';
import { settle, type Variants } from './variants.js';
import { scaled } from './view.js';

/** What an image size needs where the rasterizer cannot write the target. */
interface Accumulation {
  readonly texture: AccumulationTexture;
  readonly compose: ComposeBindings;
}

/** In how many parts the painting of a frame is handed over, and who times them. */
interface Submissions {
  readonly parts: number;
  readonly watch?: SubmissionWatch;
}

/** A target, and whether a compute shader may write it. */
interface Target extends Surface {
  readonly isStorable: boolean;
}

const TRANSPARENT = [0, 0, 0, 0] as const;
/** Of a target: a view of more than that is none to draw into. */
const ONE_PICTURE: GPUTextureViewDescriptor = { dimension: '2d', mipLevelCount: 1, arrayLayerCount: 1 };

/**
 * Draws Gaussians into a texture, on a device of yours.
 *
 * ```ts
 * const renderer = new Renderer(device);
 * const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
 * renderer.render({ gaussians, camera, target: texture });
 * ```
 *
 * Memory is allocated when the scenes, the image size or the share of visible splats change, never while only the camera moves; no frame waits
 * for a read-back. Each frame sorts the splats that it shows.
 */
export class Renderer {
  /** The levers in force; nothing is left `auto`. */
  readonly levers: Levers & Variants;
  readonly #device: GPUDevice;
  /** Those of frames that ask for other ones. */
  readonly #frameLevers = new WeakMap<Partial<FrameLevers>, Levers & Variants>();
  readonly #stages: Stages;
  readonly #compose: ComposeStage;
  readonly #rasterizer: Rasterizer;
  readonly #pacer: SubmissionPacer;
  readonly #onIncomplete: () => void;
  readonly #memory: GpuMemory;
  readonly #composeUniform: GPUBuffer;
  readonly #composeBytes = new ArrayBuffer(layouts.Compose.size);
  readonly #views = new WeakMap<GPUTexture, GPUTextureView>();
  readonly #resources: FrameResources;
  #accumulation: Accumulation | undefined;
  /** The buffers of the last frame, and its pixels for each of the target; undefined before there is one. */
  #last: { readonly scratch: Scratch; readonly scale: number } | undefined;

  /** @throws GaussianSplatError `unsupported/limits` if an option needs a feature that the device lacks. */
  constructor(device: GPUDevice, options: RendererOptions = {}) {
    this.#device = device;
    this.levers = settle(device, leversOf(options));
    this.#onIncomplete = options.onIncomplete ?? (() => undefined);
    this.#stages = makeStages(device, this.levers);
    this.#compose = new ComposeStage(device);
    this.#rasterizer = makeRasterizer(device, this.levers);
    this.#pacer = new SubmissionPacer(device);
    this.#resources = new FrameResources(device, {
      stages: this.#stages,
      rasterizer: this.#rasterizer,
      pairsAtOnce: () => this.#pacer.pairsAtOnce,
      onIncomplete: this.#onIncomplete,
    });
    this.#memory = new GpuMemory(device);
    const usage = BUFFER_USAGE.uniform | BUFFER_USAGE.copyDestination;
    this.#composeUniform = this.#memory.buffer('gs.compose.uniform', layouts.Compose.size, usage);
  }

  /** Name of the rasterizer in use. */
  get rasterizer(): RasterizerName {
    return this.#rasterizer.name;
  }

  /** Bytes of GPU memory held between frames, scenes not counted. */
  get byteLength(): number {
    const parts = [this.#memory, this.#resources, this.#rasterizer, this.#accumulation?.texture];
    return parts.reduce((sum, part) => sum + (part?.byteLength ?? 0), 0);
  }

  /** What the last frame that took notes was painted from; undefined before there is one. */
  get noted(): NotedFrame | undefined {
    return this.#rasterizer.noted;
  }

  /**
   * Makes what frames with other levers need, so that none of them has to. Their memory, next to nothing, comes with the next frame.
   * @param targetFormat format of the targets
   * @throws GaussianSplatError `argument/value` for a lever out of range.
   */
  prepare(levers: readonly Partial<FrameLevers>[], targetFormat: GPUTextureFormat): void {
    for (const changes of levers) this.#rasterizer.prepare(this.#leversOf(changes), targetFormat);
    const isSmaller = levers.some(({ resolutionScale = 1 }) => resolutionScale < 1);
    if (isSmaller) this.#compose.prepare(targetFormat, this.#rasterizer.finishes(targetFormat));
  }

  /**
   * Encodes and submits one frame.
   * @throws GaussianSplatError `argument/camera` for a camera out of range; `argument/value` for another argument; `out-of-memory/buffer-limit` if the scenes
   * need a larger buffer than the device allows.
   */
  render(request: FrameRequest): void {
    const { camera, background = TRANSPARENT, notes, timer } = request;
    requireRequest(request);
    validateCamera(camera);
    requireTextureSize(this.#device, camera);
    if (notes) requireNotes(this.#rasterizer);
    const target = this.#targetOf(request);
    const scenes = Array.isArray(request.gaussians) ? request.gaussians : [request.gaussians as GaussianScene];
    const levers = this.#leversOf(request.levers);
    const detail = detailOf(request, levers);
    const drawn = scaled(camera, levers.resolutionScale);
    const resources = this.#resources.fit(scenes, detail.splatBudget);
    const { table, scratch, bindings, monitor } = resources;
    table.update();
    timer?.startFrame();
    const encoder = this.#device.createCommandEncoder({ label: 'gs.frame' });
    const own = { ...levers, ...detail };
    const pixelArea = (drawn.width * drawn.height) / (camera.width * camera.height);
    table.look(drawn, pixelArea, own, request.filter);
    const wishes = recordProjection(encoder, {
      stages: this.#stages,
      bindings,
      scratch,
      camera: drawn,
      levers: own,
      keepsSurvivors: notes !== undefined,
      hasDetail: table.hasDetail,
      isBudgeted: detail.splatBudget > 0 && table.hasDetail,
      timer,
    });
    const { pairPlan } = this.#rasterizer;
    const isWatched = monitor.isDue(pairPlan !== undefined, {
      pixels: drawn.width * drawn.height,
      wholePixels: camera.width * camera.height,
      isWhole: request.levers === undefined,
    });
    const submissions = this.#submissionsFor(isWatched);
    const how = { levers, notes, survivors: notes && scratch.survivors, timer };
    const last = this.#paint(encoder, target, drawn, how, background, submissions);
    timer?.endFrame?.(last);
    if (isWatched) monitor.record(last, scratch.plan, pairPlan);
    this.#submit(last, submissions);
    timer?.submitted?.();
    this.#last = { scratch, scale: drawn.width / camera.width };
    const counts = isWatched ? monitor.read() : undefined;
    if (counts && submissions.watch) {
      void this.#pacer.learn(
        submissions.watch,
        counts.then((painted) => painted?.pairs),
      );
    }
    for (const wish of wishes) wish.read();
  }

  /** Counts of the last frame. Reads back from the GPU: for tests and panels, not for every frame. */
  async readStatistics(): Promise<FrameStatistics> {
    const resources = this.#resources.current;
    if (resources === undefined)
      return { visible: 0, overflow: 0, pairs: 0, pairOverflow: 0, unusable: 0, budgetError: 0 };
    const { plan, gathered, chunkShares } = resources.scratch;
    return readStatistics(this.#device, { plan, gathered, chunkShares, pairPlan: this.#rasterizer.pairPlan });
  }

  /**
   * Whether the last frame had room for all that it should show; if not, the next one will. Reads back from the GPU: for single
   * images, not for every frame.
   */
  async isComplete(): Promise<boolean> {
    if (this.#resources.current === undefined) return true;
    const { visible, overflow, pairs, pairOverflow } = await this.readStatistics();
    return this.hadRoom(Uint32Array.of(visible, overflow, pairs, pairOverflow));
  }

  /**
   * Copies the counts that {@link hadRoom} judges into 16 bytes of a buffer, for those who draw many images before they read anything back.
   * @param offset bytes, a multiple of 4
   */
  copyCounts(encoder: GPUCommandEncoder, buffer: GPUBuffer, offset: number): void {
    const { scratch } = this.#resources.current ?? {};
    if (scratch) copyCounts(encoder, scratch.plan, this.#rasterizer.pairPlan, buffer, offset);
  }

  /** Whether the frame that these four counts are from had room for all that it should show; if not, those that follow will. */
  hadRoom([visible, overflow, pairs, pairOverflow]: Uint32Array): boolean {
    if (overflow + pairOverflow === 0) return true;
    this.#resources.current?.monitor.judge({ visible: visible + overflow, pairs: pairs + pairOverflow }, false);
    return false;
  }

  /**
   * Looks into the last frame at single points of it: how opaque it is there, where its surface lies, what hides a given depth. The same
   * for all rasterizers. Reads back from the GPU: for clicks and labels, not for every frame. Rejects if the device is lost meanwhile,
   * and with GaussianSplatError `network/unreachable` if the code for it cannot be loaded.
   * @returns an answer for each point; none before the first frame.
   */
  async probeDepth(points: readonly ProbePoint[]): Promise<ProbeAnswer[]> {
    const { probe } = await loadModule('the code that looks into a picture', () => import('./depth-probe.js'));
    if (this.#last === undefined || this.#last.scratch !== this.#resources.current?.scratch) return [];
    const { scale, scratch } = this.#last;
    const { plan, splats, order } = scratch;
    const drawn = points.map(({ x, y, depth }) => ({ x: x * scale, y: y * scale, depth }));
    return probe(this.#device, { plan, splats, order: order[0] }, drawn);
  }

  /** Frees all GPU memory. Scenes are not touched: they belong to whoever uploaded them. */
  destroy(): void {
    this.#resources.release();
    this.#accumulation?.texture.destroy();
    this.#accumulation = undefined;
    this.#rasterizer.destroy();
    this.#memory.destroy();
  }

  #paint(
    encoder: GPUCommandEncoder,
    target: Target,
    camera: Camera,
    how: Pick<Painting, 'levers' | 'notes' | 'survivors' | 'timer'>,
    background: readonly [number, number, number, number],
    submissions: Submissions,
  ): GPUCommandEncoder {
    const isFullSize = camera.width === target.width && camera.height === target.height;
    const isStored = target.isStorable && this.#rasterizer.finishes(target.format);
    if (isFullSize && isStored) {
      return this.#recordParts(encoder, { ...how, surface: target, background }, submissions);
    }
    const { texture, compose } = this.#accumulationOf(camera, target);
    const scale = [camera.width / target.width, camera.height / target.height];
    const used = [camera.width, camera.height];
    writeStruct(layouts.Compose, { background, scale, used }, this.#composeBytes);
    this.#device.queue.writeBuffer(this.#composeUniform, 0, this.#composeBytes);
    const { view, format } = texture;
    const surface = { view, format, width: camera.width, height: camera.height };
    const last = this.#recordParts(encoder, { ...how, surface }, submissions);
    if (isStored) this.#compose.store(last, compose, target, how.timer);
    else this.#compose.draw(last, compose, target, how.timer);
    return last;
  }

  /** How this frame is handed over: in one submission, or in as many as keep each short. */
  #submissionsFor(isWatched: boolean): Submissions {
    const least = Math.ceil(this.levers.submissions);
    if (this.#rasterizer.pairPlan === undefined) return { parts: least };
    const pairs = this.#resources.pairCapacity;
    const watch = isWatched && this.#pacer.wantsToKnow(pairs) ? this.#pacer.watch() : undefined;
    return { parts: Math.max(least, this.#pacer.partsFor(pairs)), watch };
  }

  #submit(encoder: GPUCommandEncoder, { watch }: Submissions): void {
    this.#device.queue.submit([encoder.finish()]);
    watch?.note();
  }

  /** Records the painting, in several submissions where that is asked for. @returns the encoder to go on with */
  #recordParts(encoder: GPUCommandEncoder, painting: Painting, submissions: Submissions): GPUCommandEncoder {
    const { parts: count } = submissions;
    this.#rasterizer.prepareFrame(encoder, painting);
    let current = encoder;
    for (let index = 0; index < count; index++) {
      // What comes before the painting is a submission of its own, too.
      if (count > 1) {
        this.#submit(current, submissions);
        current = this.#device.createCommandEncoder({ label: `gs.frame.${index}` });
      }
      this.#rasterizer.record(current, painting, { index, count });
    }
    return current;
  }

  #leversOf(changes: Partial<FrameLevers> | undefined): Levers & Variants {
    if (changes === undefined) return this.levers;
    const known = this.#frameLevers.get(changes);
    if (known) return known;
    const made = leversOfFrame(this.levers, changes);
    this.#frameLevers.set(changes, made);
    return made;
  }

  #targetOf({ target, targetFormat, camera }: FrameRequest): Target {
    const { width, height } = camera;
    if (!isTexture(target)) {
      if (targetFormat === undefined) throw missingFormat();
      requireTarget(undefined, targetFormat, camera);
      return { view: target, format: targetFormat, isStorable: false, width, height };
    }
    requireTarget(target, target.format, camera);
    let view = this.#views.get(target);
    if (view === undefined) this.#views.set(target, (view = target.createView(ONE_PICTURE)));
    const isStorable = (target.usage & TEXTURE_USAGE.storageBinding) !== 0;
    return { view, format: target.format, isStorable, width, height };
  }

  /** As large as frames of this target are without levers of their own: one with fewer pixels paints a part of it. */
  #accumulationOf(drawn: Camera, target: Target): Accumulation {
    const share = this.levers.resolutionScale;
    const width = Math.max(drawn.width, Math.round(target.width * share));
    const height = Math.max(drawn.height, Math.round(target.height * share));
    const current = this.#accumulation;
    if (current?.texture.width === width && current.texture.height === height) return current;
    current?.texture.destroy();
    const texture = new AccumulationTexture(this.#device, this.levers.accumulation, width, height);
    const compose = this.#compose.bind({ compose: this.#composeUniform, accumulated: texture.view });
    this.#accumulation = { texture, compose };
    return this.#accumulation;
  }
}

/** The levers of detail of a frame. */
function detailOf(request: FrameRequest, levers: Levers): Pick<Levers, 'detail' | 'splatBudget'> {
  const { detail = levers.detail, splatBudget = levers.splatBudget } = request;
  requireInRange('detail', detail, 'FrameRequest');
  requireInRange('splatBudget', splatBudget, 'FrameRequest');
  return { detail, splatBudget };
}

const isTexture = (target: GPUTexture | GPUTextureView): target is GPUTexture => 'createView' in target;
