import { loadModule, validateCamera, type Camera } from '@gaussian-splat/core';
import type { ProbeAnswer, ProbePoint, ProbeSource } from './depth-probe.js';
import type { Scratch } from './scratch.js';
import { recordProjection } from './frame.js';
import { Engine, type Accumulation } from './engine.js';
import type { Resources } from './frame-resources.js';
import type { PageRequests } from './gaussian-scene.js';
import { constants, layouts } from './generated/shaders.js';
import { BUFFER_USAGE, TEXTURE_USAGE } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';
import type { FrameTimer } from './gpu/pass-timer.js';
import { writeStruct } from './gpu/struct.js';
import { orderOn } from './pixel-order-loader.js';
import type { RenderSettings } from './render-settings.js';
import type { FrameSettings, FrameTarget, Target } from './frame-target.js';
import { OverdrawLimit } from './overdraw.js';
import type { PixelOrder } from './rasterizers/pixel-order.js';
import type { AuxiliaryFrame, AuxiliaryTilePainter, Painting, RasterizerName } from './rasterizers/rasterizer.js';
import { ComposeStage } from './stages/compose.js';
import { SubmissionPacer, type SubmissionWatch } from './submission-pacer.js';
import type { FrameCounts } from './capacity.js';
import { checkArguments, checkFrame, settingsOf } from './checks.js';
import { copyCounts } from './copy-counts.js';
import type { FrameStats } from './frame-stats.js';
import { resolveSettings, variantsOf, type Variants } from './variants.js';
import { scaled } from './view.js';
import type { World } from './world.js';

/** Number of submissions of a frame, and the watch that times them. */
interface Submissions {
  readonly parts: number;
  readonly watch?: SubmissionWatch;
}

const TRANSPARENT = [0, 0, 0, 0] as const;
/** Descriptor of a target's view: a render attachment has one level and one layer. */
const ONE_IMAGE: GPUTextureViewDescriptor = { dimension: '2d', mipLevelCount: 1, arrayLayerCount: 1 };

/** Options of a {@link Viewpoint}. */
export interface ViewpointOptions {
  /** Default settings of frames. They determine the allocations of the viewpoint. */
  readonly settings?: FrameSettings;
  /**
   * Called when a drawn frame lacked splats because of the capacity of the viewpoint's buffers, or its code had not
   * loaded. Draw the next frame, which has enough capacity.
   */
  readonly onIncomplete?: () => void;
  /**
   * Whether to draw fewer pixels if the splats of a frame cover it too often: more than 1,000 times, plus once for each
   * 500 splats. The largest splats are missing until the coverage is known: see `onIncomplete`. Default: false.
   */
  readonly limitsOverdraw?: boolean;
}

/** A frame that has been encoded, and what follows after its last command. */
interface Encoded {
  /** Encoder for the commands after the frame. */
  readonly last: GPUCommandEncoder;
  /** Whether the counts of the frame are to be read. */
  readonly isWatched: boolean;
  readonly submissions: Submissions;
  /** Page requests of streamed scenes, which are to be read after the submit. */
  readonly requests: readonly PageRequests[];
  readonly resources: Resources;
}

/**
 * Draws a world on a device of the host.
 *
 * ```ts
 * const world = new World();
 * world.add({ scene: await GaussianBuffers.upload(device, packGaussians(cloud)) });
 * const viewpoint = new Viewpoint(device, world);
 * viewpoint.draw(camera, { target: texture });
 * ```
 *
 * Memory is allocated when scenes are added, and when the image size or the fraction of visible splats changes. Nothing
 * is allocated while only the camera or a scene moves. No frame waits for a read-back. Each frame sorts the splats that
 * it shows.
 */
export class Viewpoint {
  readonly world: World;
  /**
   * Number of image sizes whose buffers are kept between frames. Hosts that draw several views in turn, such as two
   * eyes or thumbnails, need more than one.
   */
  maxSizes = 1;
  readonly #device: GPUDevice;
  /** Resolved settings by the settings object. */
  #known = new WeakMap<FrameSettings, RenderSettings & Variants>();
  /** Variants that replace `auto`. They change only with the settings, not from frame to frame. */
  #variants: Variants;
  readonly #compose: ComposeStage;
  readonly #pacer: SubmissionPacer;
  readonly #onIncomplete: () => void;
  readonly #overdraw: OverdrawLimit | undefined;
  readonly #memory: GpuMemory;
  readonly #composeUniform: GPUBuffer;
  readonly #composeBytes = new ArrayBuffer(layouts.Compose.size);
  readonly #views = new WeakMap<GPUTexture, GPUTextureView>();
  #settings: FrameSettings;
  #engine: Engine;
  /** Auxiliary outputs of the last frame with such outputs. */
  #auxiliary: AuxiliaryTilePainter | undefined;
  /** Whether the last frame was drawn by `center`, because the code for `order: 'pixel'` was still loading. */
  #lacksOrder = false;
  /** Inputs of the last frame, and its width as a fraction of the target's; undefined before the first frame. */
  #last: (ProbeSource & { readonly scale: number }) | undefined;

  /** @throws GaussianSplatError `unsupported/limits` if settings need a feature that the device lacks. */
  constructor(
    device: GPUDevice,
    world: World,
    { settings = {}, onIncomplete, limitsOverdraw = false }: ViewpointOptions = {},
  ) {
    this.#device = device;
    this.world = world;
    this.#variants = variantsOf(device);
    this.#settings = settings;
    this.#onIncomplete = onIncomplete ?? (() => undefined);
    this.#overdraw = limitsOverdraw ? new OverdrawLimit() : undefined;
    this.#compose = new ComposeStage(device);
    this.#pacer = new SubmissionPacer(device);
    this.#memory = new GpuMemory(device);
    const usage = BUFFER_USAGE.uniform | BUFFER_USAGE.copyDestination;
    this.#composeUniform = this.#memory.buffer('gs.compose.uniform', layouts.Compose.size, usage);
    this.#engine = this.#makeEngine(this.#resolve(settings));
  }

  /** Default settings of frames. A change updates the variants that replace `auto`. */
  get settings(): FrameSettings {
    return this.#settings;
  }

  set settings(settings: FrameSettings) {
    if (settings === this.#settings) return;
    this.#variants = variantsOf(this.#device);
    this.#known = new WeakMap();
    const resolved = this.#resolve(settings);
    this.#settings = settings;
    this.#useEngine(resolved);
  }

  /** The {@link settings}, with every `auto` replaced by the variant of the device. */
  get resolvedSettings(): RenderSettings & Variants {
    return this.#resolve(this.#settings);
  }

  /** Name of the rasterizer in use. */
  get rasterizer(): RasterizerName {
    return this.#engine.rasterizer.name;
  }

  /** Resolution scale of each side that the overdraw limit requires, 0..1. */
  get pixelShare(): number {
    return this.#overdraw?.share ?? 1;
  }

  /** Bytes of GPU memory that is kept between frames, without the scenes. */
  get byteLength(): number {
    return this.#memory.byteLength + this.#engine.byteLength;
  }

  /** Rasterization inputs of the last frame with auxiliary outputs; undefined before the first such frame. */
  get auxiliary(): AuxiliaryFrame | undefined {
    return this.#auxiliary?.frame;
  }

  /**
   * Compiles the pipelines for other settings, so that no frame compiles them. Their small amount of memory is
   * allocated with the next frame.
   * @param targetFormat Format of the targets.
   * @throws GaussianSplatError `argument/value` for a setting out of range.
   */
  prepare(settings: readonly FrameSettings[], targetFormat: GPUTextureFormat): void {
    const { rasterizer } = this.#engine;
    const all = settings.map((each) => this.#resolve(each));
    for (const resolved of all) {
      const order = resolved.order === 'pixel' ? orderOn(this.#device).now : undefined;
      rasterizer.prepare(resolved, targetFormat, order?.painter(resolved));
    }
    const isSmaller = all.some(({ resolutionScale }) => resolutionScale < 1);
    if (isSmaller) this.#compose.prepare(targetFormat, rasterizer.finishes(targetFormat));
  }

  /**
   * Encodes and submits one frame.
   * @throws GaussianSplatError `argument/camera` for a camera out of range; `argument/value` for another argument;
   * `out-of-memory/buffer-limit` if the scenes need a larger buffer than the device allows.
   */
  draw(camera: Camera, frameTarget: FrameTarget, settings: FrameSettings = this.#settings): void {
    const encoder = this.#device.createCommandEncoder({ label: 'gs.frame' });
    const encoded = this.#encode(encoder, camera, frameTarget, settings, true);
    this.#close(encoded.last, encoded, frameTarget.timer);
  }

  /**
   * Records one frame into a host's encoder, between passes of the host, and submits nothing. The host must submit the
   * encoder within the same task, because the next frame reads the counts and page requests of this one. Record a
   * viewpoint only once for each submission, because its uniforms are those of the last recorded frame. `submissions`
   * of the settings and `timer` of the frame are ignored.
   * @throws GaussianSplatError as {@link draw} does.
   */
  record(encoder: GPUCommandEncoder, camera: Camera, frameTarget: FrameTarget, settings = this.#settings): void {
    const encoded = this.#encode(encoder, camera, { ...frameTarget, timer: undefined }, settings, false);
    if (!encoded.isWatched && encoded.requests.length === 0) return;
    // The timeout runs after the host has submitted the frame in its task.
    setTimeout(() => {
      if (this.#engine.resources.current === encoded.resources)
        this.#close(this.#device.createCommandEncoder({ label: 'gs.read' }), encoded);
    });
  }

  /**
   * Records a frame. Returns the encoder for the commands after the frame, and the data that {@link #close} needs.
   * @param mayDivide Whether the frame may be divided into several submissions.
   */
  #encode(
    encoder: GPUCommandEncoder,
    camera: Camera,
    frameTarget: FrameTarget,
    settings: FrameSettings,
    mayDivide: boolean,
  ): Encoded {
    const { auxiliary, timer, depth } = frameTarget;
    validateCamera(camera);
    checkArguments(this.#device, camera, frameTarget, settings);
    const asked = this.#resolve(settings);
    checkFrame(camera, frameTarget, asked);
    const target = this.#targetOf(frameTarget, camera);
    const order = this.#orderOf(asked);
    this.#lacksOrder = !order && asked.order === 'pixel';
    // Exact keys let a pixel end at the first splat that a mesh hides.
    const isExact = (depth && !order) || asked.order === 'distance';
    const resolved = isExact
      ? { ...asked, depthKeyBits: 32 as const, ...(depth && { order: 'center' as const }) }
      : asked;
    const { resources: all, rasterizer, stages } = this.#useEngine(resolved);
    const drawn = scaled(camera, resolved.resolutionScale * this.pixelShare);
    depth?.prepare(camera, drawn, rasterizer.name, auxiliary);
    const resources = all.fit(this.world, resolved.splatBudget);
    const { table, scratch, bindings, monitor } = resources;
    table.update();
    timer?.startFrame();
    const pixelArea = (drawn.width * drawn.height) / (camera.width * camera.height);
    const look = (seen: Camera): void =>
      table.look(seen, pixelArea, resolved, frameTarget.filter, this.#overdraw?.maxFor(table.splats));
    look(drawn);
    const requests = (frameTarget.project ?? recordProjection)(encoder, {
      look,
      stages,
      bindings,
      scratch,
      camera: drawn,
      settings: resolved,
      keepsSurvivors: auxiliary !== undefined,
      hasDetail: table.hasDetail,
      isBudgeted: resolved.splatBudget > 0 && table.detailBudget !== undefined,
      order,
      keepsDepths: depth !== undefined && !order,
      timer,
    });
    const isWatched = monitor.isDue(
      rasterizer.pairPlan !== undefined || this.#overdraw?.mayExceed(table.splats) === true,
      {
        pixels: drawn.width * drawn.height,
        wholePixels: camera.width * camera.height,
        isWhole: isWhole(resolved, this.resolvedSettings),
      },
    );
    const submissions = mayDivide ? this.#submissionsFor(isWatched) : { parts: 1 };
    const how = { settings: resolved, timer, ...this.#wayToPaint(frameTarget, resolved, drawn, scratch, order) };
    const last = this.#paint(encoder, target, drawn, how, frameTarget, submissions);
    this.#last = { stages, bindings, scale: drawn.width / camera.width };
    return { last, isWatched, submissions, requests, resources };
  }

  /** Submits the last commands of a frame, and starts to read its counts and page requests. */
  #close(encoder: GPUCommandEncoder, frame: Encoded, timer?: FrameTimer): void {
    const { isWatched, submissions, requests, resources } = frame;
    timer?.endFrame?.(encoder);
    for (const request of requests) request.copy(encoder);
    const { pairPlan, longest } = this.#engine.rasterizer;
    const isRead = isWatched && resources.monitor.record(encoder, resources.scratch, pairPlan, longest);
    this.#submit(encoder, submissions);
    timer?.submitted?.();
    const counts = isRead ? this.#read(resources) : undefined;
    if (counts && submissions.watch) {
      void this.#pacer.learn(
        submissions.watch,
        counts.then((painted) => painted?.pairs),
      );
    }
    for (const request of requests) request.read();
  }

  /**
   * Reads the counts of a frame, and updates the capacity and the overdraw limit. Resolves to undefined if the device
   * is lost.
   */
  async #read({ monitor, table }: Resources): Promise<FrameCounts | undefined> {
    const counts = await monitor.read();
    if (counts) this.#engine.rasterizer.learn?.(counts.longest);
    if (counts && this.#overdraw?.note(counts.covered / constants.COVERED_UNIT, table.splats)) this.#onIncomplete();
    return counts;
  }

  /**
   * Returns the counts of the last frame. Reads back from the GPU: call this for tests and panels, not for every frame.
   */
  async stats(): Promise<FrameStats> {
    const { readFrameStats } = await loadModule('the code for counts', () => import('./frame-stats.js'));
    const { scratch } = this.#engine.resources.current ?? {};
    return readFrameStats(this.#device, scratch, this.#engine.rasterizer.pairPlan);
  }

  /**
   * Returns the stages for `order: 'pixel'`. Undefined for other orders, and while their code is loading. {@link
   * ViewpointOptions.onIncomplete} is then called after the load.
   */
  #orderOf({ order }: RenderSettings): PixelOrder | undefined {
    if (order !== 'pixel') return undefined;
    const lazy = orderOn(this.#device);
    // This promise ignores a failed load: `isComplete` rejects with its error.
    if (!lazy.now) lazy.load().then(this.#onIncomplete, () => undefined);
    return lazy.now;
  }

  /**
   * Whether the last frame had enough capacity and all code to show everything. Otherwise the next frame will. Reads
   * back from the GPU: call it for single images, not for every frame. Rejects if code cannot be loaded.
   */
  async isComplete(): Promise<boolean> {
    if (this.#engine.resources.current === undefined) return true;
    if (this.#lacksOrder) {
      await orderOn(this.#device).load();
      return false;
    }
    const { visible, overflow, pairs, pairOverflow, covered } = await this.stats();
    const hadRoom = this.hadRoom(Uint32Array.of(visible, overflow, pairs, pairOverflow));
    // Undefined if the viewpoint was destroyed, or got other variants, during the read-back.
    const { table } = this.#engine.resources.current ?? {};
    return !(table && this.#overdraw?.note(covered, table.splats)) && hadRoom;
  }

  /**
   * Copies the counts for {@link hadRoom} into 16 bytes of a buffer, for callers that draw many images before a
   * read-back.
   * @param offset Offset in the buffer in bytes, a multiple of 4.
   */
  copyCounts(encoder: GPUCommandEncoder, buffer: GPUBuffer, offset: number): void {
    const { scratch } = this.#engine.resources.current ?? {};
    if (scratch) copyCounts(encoder, scratch.plan, this.#engine.rasterizer.pairPlan, buffer, offset);
  }

  /**
   * Whether the frame with these four counts had enough capacity. Otherwise the capacity grows for the following
   * frames.
   */
  hadRoom([visible, overflow, pairs, pairOverflow]: Uint32Array): boolean {
    if (overflow + pairOverflow === 0) return true;
    this.#engine.resources.current?.monitor.judge({ visible: visible + overflow, pairs: pairs + pairOverflow }, false);
    return false;
  }

  /**
   * Probes points of the last frame: opacity, depth of the surface, and transmittance in front of a given depth. Works
   * with all rasterizers. Reads back from the GPU: call it for clicks and labels, not for every frame. Rejects if the
   * device is lost meanwhile, and with GaussianSplatError `network/unreachable` if its code cannot be loaded.
   * @param points Points in pixels of the target.
   * @returns An answer for each point; empty before the first frame.
   */
  async probe(points: readonly ProbePoint[]): Promise<ProbeAnswer[]> {
    const { probe } = await loadModule('the code that measures depth', () => import('./depth-probe.js'));
    if (this.#last === undefined || this.#last.bindings.scratch !== this.#engine.resources.current?.scratch) return [];
    const { scale, stages, bindings } = this.#last;
    const drawn = points.map(({ x, y, depth }) => ({ x: x * scale, y: y * scale, depth }));
    return probe(this.#device, { stages, bindings }, drawn);
  }

  /** Frees all GPU memory of the viewpoint. Scenes belong to their creators. */
  destroy(): void {
    this.#engine.destroy();
    this.#last = undefined;
    this.#memory.destroy();
  }

  #paint(
    encoder: GPUCommandEncoder,
    target: Target,
    camera: Camera,
    how: Pick<Painting, 'settings' | 'timer' | 'depth' | 'depths' | 'painter'>,
    { background: behind, colors }: FrameTarget,
    submissions: Submissions,
  ): GPUCommandEncoder {
    const keeps = behind === 'load';
    const background = keeps ? TRANSPARENT : (behind ?? TRANSPARENT);
    const isFullSize = camera.width === target.width && camera.height === target.height;
    const isStored = target.isStorable && !keeps && !colors && this.#engine.rasterizer.finishes(target.format);
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
    if (colors) colors.compose(last, compose.resources, target, keeps);
    else if (isStored) this.#compose.store(last, compose, target, how.timer);
    else this.#compose.draw(last, compose, target, how.timer, keeps);
    return last;
  }

  /** Returns the number of submissions of this frame, which keeps each of them short. */
  #submissionsFor(isWatched: boolean): Submissions {
    const min = Math.ceil(this.resolvedSettings.submissions);
    if (this.#engine.rasterizer.pairPlan === undefined) return { parts: min };
    const pairs = this.#engine.resources.pairCapacity;
    const watch = isWatched && this.#pacer.wantsToKnow(pairs) ? this.#pacer.watch() : undefined;
    return { parts: Math.max(min, this.#pacer.partsFor(pairs)), watch };
  }

  #submit(encoder: GPUCommandEncoder, { watch }: Submissions): void {
    this.#device.queue.submit([encoder.finish()]);
    watch?.note();
  }

  /** Selects the variant of the rasterizer for frames with depth, auxiliary outputs, or an order for each pixel. */
  #wayToPaint(
    { depth, auxiliary }: FrameTarget,
    resolved: RenderSettings,
    camera: Camera,
    scratch: Scratch,
    order: PixelOrder | undefined,
  ): Pick<Painting, 'depth' | 'depths' | 'painter'> {
    if (order) return { painter: order.painter(resolved, camera, scratch, depth) };
    if (depth) return { depth, depths: scratch.depths, painter: depth.painter(scratch.depths) };
    if (!auxiliary) return {};
    const painter = auxiliary.painter(this.#device, scratch.survivors);
    this.#auxiliary = painter;
    return { painter };
  }

  /**
   * Records the rasterization, in several submissions if required. @returns The encoder for the commands that follow.
   */
  #recordParts(encoder: GPUCommandEncoder, painting: Painting, submissions: Submissions): GPUCommandEncoder {
    const { parts: count } = submissions;
    this.#engine.rasterizer.prepareFrame(encoder, painting);
    let current = encoder;
    for (let index = 0; index < count; index++) {
      // Submits the previous part; the first one contains the stages before the rasterizer.
      if (count > 1) {
        this.#submit(current, submissions);
        current = this.#device.createCommandEncoder({ label: `gs.frame.${index}` });
      }
      this.#engine.rasterizer.record(current, painting, { index, count });
    }
    return current;
  }

  /** Resolves settings for this device: every `auto` is replaced by a variant. The result is cached. */
  #resolve(settings: FrameSettings): RenderSettings & Variants {
    const known = this.#known.get(settings);
    if (known) return known;
    const made = resolveSettings(this.#variants, settingsOf(settings));
    this.#known.set(settings, made);
    return made;
  }

  /** Returns the engine for frames with these settings. Replaces the engine if they need other variants. */
  #useEngine(resolved: RenderSettings & Variants): Engine {
    if (this.#engine.serves(resolved)) return this.#engine;
    const engine = this.#makeEngine(resolved);
    this.#engine.destroy();
    this.#last = undefined;
    return (this.#engine = engine);
  }

  #makeEngine(resolved: RenderSettings & Variants): Engine {
    const pairsAtOnce = (): number => this.#pacer.pairsAtOnce;
    return new Engine(this.#device, resolved, { pairsAtOnce, onIncomplete: this.#onIncomplete });
  }

  #targetOf({ target }: FrameTarget, camera: Camera): Target {
    const { width, height } = camera;
    if (!isTexture(target)) {
      return { view: target.view, format: target.format, isStorable: false, width, height };
    }
    let view = this.#views.get(target);
    if (view === undefined) this.#views.set(target, (view = target.createView(ONE_IMAGE)));
    const isStorable = (target.usage & TEXTURE_USAGE.storageBinding) !== 0;
    return { view, texture: target, format: target.format, isStorable, width, height };
  }

  /**
   * Returns the accumulation for frames of this target. Its size is that of frames at the default settings; frames with
   * fewer pixels use a part of it.
   */
  #accumulationOf(drawn: Camera, target: Target): Accumulation {
    const share = this.resolvedSettings.resolutionScale;
    const width = Math.max(drawn.width, Math.round(target.width * share));
    const height = Math.max(drawn.height, Math.round(target.height * share));
    return this.#engine.accumulationOf({ width, height }, this.maxSizes, (accumulated) =>
      this.#compose.bind({ compose: this.#composeUniform, accumulated }),
    );
  }
}

/**
 * Whether a frame has at least the resolution and the accuracy of the settings at rest. Other frames say less about the
 * required capacity.
 */
const isWhole = (resolved: RenderSettings, base: RenderSettings): boolean =>
  resolved.resolutionScale >= base.resolutionScale && resolved.transmittanceMin <= base.transmittanceMin;

const isTexture = (target: FrameTarget['target']): target is GPUTexture => 'createView' in target;
