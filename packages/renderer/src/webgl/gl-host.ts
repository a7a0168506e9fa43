import { GaussianSplatError, validateCamera, type Camera } from '@gaussian-splat/core';
import { deviceReading, type DepthPlanes } from '../depth-reading.js';
import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS, DETAIL_PLACES, ENDLESS } from '../levels/chunk-detail.js';
import { pickedSurface, placeOfSurface, surfacePoints, type PickedPlace } from '../picked-surface.js';
import { FrameDetail, resolutionFor } from './frame-detail.js';
import { GlProgram, makeTarget, makeTexture, requireMemory } from './gl.js';
import type { PackedGaussians } from '../pack/pack.js';
import { GlGaussians, positionsIn, type RunGl } from './gl-gaussians.js';
import { GlStream, type GlStreamOptions } from './gl-stream.js';
import { levelChoice } from './level-choice.js';
import type { PageSource } from '../streaming/page-source.js';
import type { StreamProgress } from '../streaming/progress.js';
import {
  firstSplats,
  GlRenderer,
  type GlFrameRequest,
  type GlFrameTarget,
  type GlQuads,
  type GlQuadsFrame,
} from './gl-renderer.js';
import { borrowState, setState } from './gl-state.js';
import { DATA_WIDTH, hostedQuadsFragment, hostedQuadsVertex, HostedView } from './shaders.js';
import type { SortAnswer, SortRequest } from './sort-splats.js';
import { isSameView, orderView, SplatOrder, type OrderView } from './splat-order.js';

/** Sorts that take more than these milliseconds do not run for each frame. They use at most this fraction of the time. */
const [QUICK_SORT_MS, SORT_SHARE] = [8, 0.25];
const { CULL_GROUP } = constants;
const TEXTURES = ['shapes', 'paints', 'order', 'stored_depth'];

/** Destination of splats in a host's frame, and the host's depth. */
export interface GlHostFrame extends Omit<GlFrameTarget, 'keeps'>, DepthPlanes {
  /**
   * Depth that hides splats. `framebuffer`, the default: the depth buffer of the framebuffer, which is copied. A depth
   * texture without comparison: it must be as large as the region of the framebuffer up to the upper right corner of
   * the rectangle. Null: no depth.
   */
  readonly depth?: 'framebuffer' | WebGLTexture | null | undefined;
  /** `DEPTH_RANGE` of the host's objects. Default: that of the context, a query that waits for the GPU process. */
  readonly depthRange?: readonly [near: number, far: number] | undefined;
}

export interface GlHostOptions {
  /**
   * Worker of the page that sorts, in place of the main thread: it calls `sortSplats` for each message. It may serve any
   * number of scenes. Until its first order the scene is not drawn.
   */
  readonly worker?: Worker;
}

/** Depth texture of a host, and the frame and the request that it is for. */
interface Hidden {
  readonly texture: WebGLTexture;
  readonly frame: GlHostFrame;
  readonly request: GlFrameRequest;
}

/** A copy of the depth of a framebuffer. */
interface DepthCopy {
  readonly texture: WebGLTexture;
  readonly target: WebGLFramebuffer;
  readonly of: WebGLFramebuffer | null;
  readonly width: number;
  readonly height: number;
}

/**
 * Draws splats in the frame of a page that has its own WebGL 2 context, for example a map or an engine. Splats are
 * blended over the host's frame, and hidden by its depth. Each call restores the state of the context.
 *
 * ```ts
 * const host = new GlHost(gl);
 * const splats = await host.load(packGaussians(cloud));
 * // In each frame, after the host has drawn opaque objects:
 * const camera = cameraFromProjection(view, projection, { width, height, clipDepth: '-1..1' });
 * if (!splats.draw(camera, { framebuffer, x, y })) requestFrame();
 * ```
 * `load([a, b])` sorts several scenes together, and `draw([cameraOfA, cameraOfB])` draws them. Splats are hidden with the
 * precision of their stored depth, 0.05 %.
 */
export class GlHost {
  readonly #gl: WebGL2RenderingContext;
  #program: GlProgram<typeof HostedView> | undefined;
  #copy: DepthCopy | undefined;
  readonly #restores: boolean;

  /**
   * @param options `restores`: whether frames restore the state of the context. Default: true. Set it to false for a host
   * that sets its own state after each call, as MapLibre does after a custom layer: reading the state makes the thread
   * wait for the GPU process.
   */
  constructor(gl: WebGL2RenderingContext, { restores = true }: { readonly restores?: boolean } = {}) {
    this.#gl = gl;
    this.#restores = restores;
  }

  /** Runs calls of the renderer or of WebGL, and then restores the state of the context. */
  readonly run: RunGl = (work) => {
    const giveBack = borrowState(this.#gl);
    try {
      return work();
    } finally {
      giveBack();
    }
  };

  /**
   * Draws the splats of a renderer over the host's frame.
   * @param request Image to draw, with the host's camera: see `cameraFromProjection`, with `clipDepth: '-1..1'`.
   * @param before Called first, with the state that the renderer assumes.
   * @throws GaussianSplatError `argument/value` for a framebuffer whose depth cannot be copied; errors of
   * `GlRenderer.render`.
   */
  draw(renderer: GlRenderer, request: GlFrameRequest, frame: GlHostFrame = {}, before?: () => void): void {
    const run: RunGl = this.#restores ? this.run : (work) => (setState(this.#gl), work());
    run(() => {
      before?.();
      const { depth = 'framebuffer' } = frame;
      const texture = depth === 'framebuffer' ? this.#copyDepth(request, frame) : depth;
      renderer.render(request, texture === null ? undefined : this.#quads({ texture, frame, request }));
      renderer.present(undefined, { ...frame, keeps: true });
    });
  }

  /**
   * Uploads a scene to the GPU, in parts; or several scenes, whose splats are sorted together. Scenes of
   * `packWithDetail` have levels of detail.
   * @throws GaussianSplatError `out-of-memory/*` if memory is insufficient; `unsupported/webgl` if the browser does not
   * compile the shaders.
   */
  async load(
    packed: PackedGaussians | readonly PackedGaussians[],
    { worker }: GlHostOptions = {},
  ): Promise<HostedSplats> {
    const all = [packed].flat();
    const counts = all.map(({ count }) => count);
    const gaussians: GlGaussians[] = [];
    try {
      for (const scene of all) gaussians.push(await GlGaussians.upload(this.#gl, scene, this.run));
      await this.run(() => GlRenderer.prepare(this.#gl));
      const renderer = this.run(() => new GlRenderer(this.#gl, ...gaussians));
      const { first, count } = firstSplats(this.#gl, counts);
      const { positions, details } = joined(all, first, count);
      const sorter = worker ? portOf(worker, positions, details) : new SplatOrder(positions);
      if (sorter instanceof SplatOrder) sorter.details = details;
      const scenes = gaussians.map((own, k) => ({
        gaussians: own,
        first: first[k],
        hasLevels: all[k].details !== undefined,
      }));
      return new HostedSplats(this, renderer, scenes, { sorter, count });
    } catch (error) {
      for (const own of gaussians) own.destroy();
      throw error;
    }
  }

  /**
   * Opens a scene of any size, and fetches its coarsest page. Frames then request the pages that they need.
   * @param source Pages: see `openPages` of `@gaussian-splat/element/pages.js`.
   * @throws GaussianSplatError `out-of-memory/*` if memory or `maxSplats` is insufficient; `unsupported/webgl` if the
   * browser does not compile the shaders; errors of the source for the first page; the reason of `signal`.
   */
  async stream(
    source: PageSource,
    { worker, ...options }: GlHostOptions & GlStreamOptions = {},
  ): Promise<HostedSplats> {
    await this.run(() => GlRenderer.prepare(this.#gl));
    const stream = await GlStream.open(this.#gl, source, options, this.run);
    try {
      const { gaussians, count } = stream;
      const renderer = this.run(() => new GlRenderer(this.#gl, gaussians));
      const positions = new Float32Array(3 * count).fill(NaN);
      const details = new Float32Array(DETAIL_NUMBERS * (count / CULL_GROUP));
      const sorter = worker ? portOf(worker, positions, details) : new SplatOrder(positions);
      if (sorter instanceof SplatOrder) sorter.details = details;
      return new HostedSplats(this, renderer, [{ gaussians, first: 0, hasLevels: true }], { sorter, count, stream });
    } catch (error) {
      stream.destroy();
      throw error;
    }
  }

  /** Frees the GPU memory of the host, without that of scenes. */
  destroy(): void {
    this.#program?.destroy();
    this.#program = undefined;
    this.#forgetCopy();
  }

  #quads({ texture, frame, request: { camera: whole } }: Hidden): GlQuads {
    const gl = this.#gl;
    this.#program ??= new GlProgram(gl, [hostedQuadsVertex, hostedQuadsFragment], HostedView, TEXTURES);
    this.#program.check();
    const program = this.#program;
    const { x = 0, y = 0 } = frame;
    return {
      use({ camera, count, textures }: GlQuadsFrame): void {
        const values = {
          ...{ viewport: [camera.width, camera.height], count },
          ...deviceReading(frame, whole, frame.depthRange ?? (gl.getParameter(gl.DEPTH_RANGE) as [number, number])),
          scale: [whole.width / camera.width, whole.height / camera.height],
          corner: [x, y + whole.height],
        };
        program.use(values, [...textures, texture]);
      },
    };
  }

  /**
   * Copies the depth of a framebuffer. A rectangle of a multisampled framebuffer can be copied only to the same
   * position, so the copy begins at the corner of the framebuffer.
   */
  #copyDepth({ camera }: GlFrameRequest, { framebuffer = null, x = 0, y = 0 }: GlHostFrame): WebGLTexture {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    const [width, height] = [x + camera.width, y + camera.height];
    const blit = ({ target }: DepthCopy): void => {
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, framebuffer);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, target);
      gl.blitFramebuffer(x, y, width, height, x, y, width, height, gl.DEPTH_BUFFER_BIT, gl.NEAREST);
    };
    const copy = this.#copy;
    if (copy?.of === framebuffer && copy.width === width && copy.height === height) {
      blit(copy);
      return copy.texture;
    }
    // The formats must be equal, and the depth format of a canvas may differ from the one its attributes suggest.
    for (const format of depthFormats(gl, framebuffer === null)) {
      const made = this.#makeCopy(format, framebuffer, width, height);
      blit(made);
      if (gl.getError() === gl.NO_ERROR) return made.texture;
    }
    throw noDepth('one that cannot be copied');
  }

  #makeCopy(format: GLenum, of: WebGLFramebuffer | null, width: number, height: number): DepthCopy {
    const gl = this.#gl;
    this.#forgetCopy();
    const texture = makeTexture(gl, format, [width, height]);
    const target = makeTarget(gl, []);
    const hasStencil = format === gl.DEPTH24_STENCIL8 || format === gl.DEPTH32F_STENCIL8;
    const attachment = hasStencil ? gl.DEPTH_STENCIL_ATTACHMENT : gl.DEPTH_ATTACHMENT;
    gl.framebufferTexture2D(gl.FRAMEBUFFER, attachment, gl.TEXTURE_2D, texture, 0);
    requireMemory(gl, `depth of ${width} x ${height} pixels`);
    return (this.#copy = { texture, target, of, width, height });
  }

  #forgetCopy(): void {
    this.#gl.deleteFramebuffer(this.#copy?.target ?? null);
    this.#gl.deleteTexture(this.#copy?.texture ?? null);
    this.#copy = undefined;
  }
}

/** A scene of {@link HostedSplats}. */
interface HostedScene {
  readonly gaussians: GlGaussians;
  /** Index of its first splat. */
  readonly first: number;
  readonly hasLevels: boolean;
}

/** How a host's scene is drawn. */
export interface GlHostDrawing extends Partial<Omit<GlFrameRequest, 'camera' | 'cameras'>> {
  /** Maximum error of levels of detail, pixels; 0 draws the finest level. Default: 0, and 1 for a streamed scene. */
  readonly detail?: number;
  /**
   * Milliseconds between frames to keep while the camera moves: `detail` rises to at most four times itself while they
   * take longer, and the resolution falls to at most half of each side. Both return when frames are in time, or the
   * camera rests. Default: none.
   */
  readonly frameMs?: number;
}

/** One scene, or several in one order, in the frames of a host. */
export class HostedSplats {
  readonly #host: GlHost;
  readonly #renderer: GlRenderer;
  readonly #scenes: readonly HostedScene[];
  /** Sorts on the main thread, or by the messages of a worker. */
  readonly #sorter: SplatOrder | MessagePort;
  readonly #stream: GlStream | undefined;
  /** Empty while the worker has it. */
  #order: Uint32Array<ArrayBuffer>;
  #sorted: readonly OrderView[] | undefined;
  /** Number of splats in an order that the next frame uploads: a task of its own would wait for the GPU process. */
  #arrived: number | undefined;
  #sortedAt = -Infinity;
  #sortMs = 0;
  #cameras: readonly Camera[] | undefined;
  /** Matrices of these cameras, copied, because a host may reuse its arrays. */
  #poses: readonly Float64Array[] = [];
  readonly #frameDetail = new FrameDetail();
  /** Error in pixels that the time of frames allows; 0 if it is the wanted one. */
  #budgetError = 0;

  /** @internal */
  constructor(
    host: GlHost,
    renderer: GlRenderer,
    scenes: readonly HostedScene[],
    { sorter, count, stream }: { sorter: SplatOrder | MessagePort; count: number; stream?: GlStream },
  ) {
    this.#stream = stream;
    this.#host = host;
    this.#renderer = renderer;
    this.#scenes = scenes;
    this.#sorter = sorter;
    this.#order = new Uint32Array(DATA_WIDTH * Math.max(1, Math.ceil(count / DATA_WIDTH)));
    if (sorter instanceof SplatOrder) return;
    sorter.onmessage = ({ data: { view, order, count } }: MessageEvent<SortAnswer<readonly OrderView[]>>) => {
      this.#order = order;
      this.#take(view, count);
    };
  }

  /** Resident pages of a streamed scene, and what limits them; undefined for other scenes. */
  get progress(): StreamProgress | undefined {
    return this.#stream && { ...this.#stream.progress, budgetError: this.#budgetError };
  }

  /**
   * Draws the scene over the host's frame.
   * @param given Camera of the host: see `cameraFromProjection`, with `clipDepth: '-1..1'`. Its view includes the
   * position of the scene. Several scenes have a camera each, all with the same projection.
   * @returns False if splats have the order of an older view, or a larger error than asked: draw again soon.
   * @throws GaussianSplatError `argument/camera` for a camera out of range; `argument/value` for a framebuffer whose
   * depth cannot be copied; `out-of-memory/allocation` if the device has too little memory.
   */
  draw(given: Camera | readonly Camera[], frame?: GlHostFrame, drawing: GlHostDrawing = {}): boolean {
    const { detail: wanted = this.#stream ? 1 : 0, frameMs = Infinity, ...how } = drawing;
    const cameras = [given].flat();
    if (cameras.length !== this.#scenes.length) throw wrongCameras(this.#scenes.length, cameras.length);
    for (const camera of cameras) validateCamera(camera);
    const isMoving = cameras.some(({ worldToCamera }, k) => !isSamePose(worldToCamera, this.#poses[k]));
    if (isMoving) this.#poses = cameras.map(({ worldToCamera }) => Float64Array.from(worldToCamera));
    const factor = frameMs < Infinity ? this.#frameDetail.next(performance.now(), frameMs, isMoving) : 1;
    const detail = factor * wanted;
    this.#budgetError = factor > 1 ? detail : 0;
    const isHere = this.#sorter instanceof SplatOrder;
    const isSortedHere = isHere && this.#sort(cameras, detail);
    const camera = cameras[0];
    const request = { camera, cameras, accumulation: 'rgba16float', shDegree: 3, ...how } as const;
    const resolutionScale = (how.resolutionScale ?? 1) * resolutionFor(factor);
    this.#host.draw(this.#renderer, { ...request, resolutionScale }, frame, this.#upload);
    this.#cameras = cameras;
    // The frame has uploaded the order of the worker, which gets its buffer again.
    return (isHere ? isSortedHere : this.#sort(cameras, detail)) && factor === 1;
  }

  /**
   * Returns the visible surface at a point of the last frame, in the space of its scene, and the number of that scene.
   * The host's own objects hide nothing. The thread does not wait for the GPU.
   * @param x Pixels from the left edge of the camera's image.
   * @param y Pixels from its top edge.
   * @returns null outside the scene, on parts less than half opaque, and before the first frame. Rejects if the context
   * is lost.
   */
  async pick(x: number, y: number): Promise<(PickedPlace & { readonly scene: number }) | null> {
    const cameras = this.#cameras;
    if (!cameras) return null;
    const points = surfacePoints(cameras[0], x, y);
    const answers = await this.#host.run(() => this.#renderer.probe(points));
    const scene = answers[0]?.splat?.scene ?? 0;
    const surface = pickedSurface(cameras[scene], points, answers);
    return surface && { ...placeOfSurface(cameras[scene], x, y, surface), scene };
  }

  destroy(): void {
    if (!(this.#sorter instanceof SplatOrder)) this.#sorter.close();
    this.#renderer.destroy();
    this.#stream?.destroy();
    for (const { gaussians } of this.#stream ? [] : this.#scenes) gaussians.destroy();
  }

  #sort(cameras: readonly Camera[], detail: number): boolean {
    const stream = this.#stream;
    stream?.follow(cameras[0], detail);
    const view = this.#scenes.map(({ gaussians: { facts }, first, hasLevels }, k): OrderView => {
      const levels = hasLevels ? levelChoice(cameras[k], facts.origin, detail) : undefined;
      return { ...orderView(cameras[k], facts.origin), first, levels };
    });
    if (!stream?.hasNews && this.#sorted?.every((old, k) => isSameView(view[k], old))) return !stream?.isBehind;
    if (!(this.#sorter instanceof SplatOrder)) {
      const order = this.#order;
      this.#order = NO_ORDER;
      if (order.length === 0) return false;
      const update = stream?.take();
      const moved = update ? [...update.positions, ...update.details].map(({ numbers }) => numbers.buffer) : [];
      const request: SortRequest<readonly OrderView[]> = { view, order, update };
      this.#sorter.postMessage(request, [order.buffer, ...moved]);
      return false;
    }
    const begin = performance.now();
    if (this.#sortMs > QUICK_SORT_MS && begin - this.#sortedAt < this.#sortMs / SORT_SHARE) return false;
    if (stream) this.#sorter.replace(stream.take());
    this.#take(view, this.#sorter.sort(view, this.#order));
    this.#sortedAt = performance.now();
    this.#sortMs = this.#sortedAt - begin;
    return true;
  }

  #take(view: readonly OrderView[], count: number): void {
    this.#arrived = count;
    this.#sorted = view;
  }

  readonly #upload = (): void => {
    if (this.#arrived === undefined) return;
    if (this.#stream?.write()) this.#renderer.splatsChanged();
    this.#renderer.setOrder(this.#order, this.#arrived);
    this.#arrived = undefined;
  };
}

const isSamePose = (a: ArrayLike<number>, b: ArrayLike<number> | undefined): boolean =>
  b !== undefined && Array.from(a).every((value, k) => value === b[k]);

const NO_ORDER = new Uint32Array(0);

/** Gives positions to a worker, and returns the port for its orders. */
function portOf(
  worker: Worker,
  positions: Float32Array<ArrayBuffer>,
  details: Float32Array<ArrayBuffer> | undefined,
): MessagePort {
  const { port1, port2 } = new MessageChannel();
  worker.postMessage({ port: port2, positions }, [port2, positions.buffer]);
  if (details) port1.postMessage({ details }, [details.buffer]);
  return port1;
}

/** Returns the positions and levels of all splats. Indices between scenes have the position NaN, which is not listed. */
function joined(
  all: readonly PackedGaussians[],
  first: readonly number[],
  count: number,
): { positions: Float32Array<ArrayBuffer>; details: Float32Array<ArrayBuffer> | undefined } {
  const positions = new Float32Array(3 * count).fill(NaN);
  for (const [k, { geometry }] of all.entries()) positions.set(positionsIn(geometry), 3 * first[k]);
  if (!all.some(({ details }) => details)) return { positions, details: undefined };
  const details = new Float32Array(DETAIL_NUMBERS * (count / CULL_GROUP));
  // Chunks of a scene without levels are the finest, and have no parent.
  for (let at = DETAIL_PLACES.parentError; at < details.length; at += DETAIL_NUMBERS) details[at] = ENDLESS;
  for (const [k, { details: own }] of all.entries())
    if (own) details.set(own, DETAIL_NUMBERS * (first[k] / CULL_GROUP));
  return { positions, details };
}

const wrongCameras = (expected: number, found: number): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'HostedSplats.draw()',
    expected: `a camera for each of ${expected} scenes`,
    found: String(found),
    remedy: 'pass the cameras as an array, in the order of load()',
  });

/** Returns the formats that the depth buffer of the bound framebuffer may have, the most likely one first. */
function depthFormats(gl: WebGL2RenderingContext, isCanvas: boolean): GLenum[] {
  const [depth, stencil] = isCanvas ? [gl.DEPTH, gl.STENCIL] : [gl.DEPTH_ATTACHMENT, gl.STENCIL_ATTACHMENT];
  const ask = (attachment: GLenum, name: GLenum): number =>
    gl.getFramebufferAttachmentParameter(gl.FRAMEBUFFER, attachment, name) as number;
  const has = (attachment: GLenum): boolean => ask(attachment, gl.FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) !== gl.NONE;
  if (!has(depth)) throw noDepth('one without depth');
  const bits = ask(depth, gl.FRAMEBUFFER_ATTACHMENT_DEPTH_SIZE);
  const [alone, both] =
    bits > 24 ? [gl.DEPTH_COMPONENT32F, gl.DEPTH32F_STENCIL8] : [gl.DEPTH_COMPONENT24, gl.DEPTH24_STENCIL8];
  const preferred = isCanvas || has(stencil) ? [both, alone] : [alone, both];
  return bits > 16 ? preferred : [gl.DEPTH_COMPONENT16, ...preferred];
}

const noDepth = (found: string): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'GlHost.draw(): depth',
    expected: 'a framebuffer with a depth buffer that can be copied, a texture of depth, or null',
    found,
    remedy: 'give depth: null, or give the framebuffer (or the context) a depth buffer',
  });
