import { loadModule, type GaussianSplatError, type Camera, type ShDegree } from '@gaussian-splat/core';
import {
  QueueClock,
  Renderer,
  type FrameRequest,
  type GaussianScene,
  type FrameLevers,
  type ProbeAnswer,
  type ProbePoint,
  type Quality,
  type WorkTime,
} from '@gaussian-splat/renderer';
import type { SceneBounds } from '../camera/settings.js';
import type { Frame, FrameFilter } from '../live/frame-filter.js';
import type { Timeline } from '../live/live-model.js';
import type { ReadCounts } from '../stats.js';
import { why } from './request-device.js';
import type { DeviceLease } from './shared-device.js';

/** How much detail is drawn of a scene that has levels of it. */
export type DetailLevers = Pick<FrameRequest, 'detail' | 'splatBudget'>;

/** A scene's Gaussians with levels of detail besides; those alone are freed with it. */
export interface OwnedLevels extends GaussianScene {
  /** Bytes of GPU memory that the levels take. */
  readonly byteLength: number;
  destroy(): void;
}

/** Gaussians with one owner. */
export interface OwnedGaussians extends GaussianScene {
  /** Splats of the frame on show, where there is room for more. */
  readonly frameCount?: number;
  /** Splats of the finest level, where the file has levels of detail. */
  readonly leafCount?: number;
  /** Splats of the file that were left out; a generator's are counted by nobody. */
  readonly droppedCount?: number;
  readonly byteLength: number;
  destroy(): void;
}

/** What a canvas shows: a context that scenes of one kind draw into. */
export interface Surface {
  readonly canvas: HTMLCanvasElement | OffscreenCanvas;
  /** Clears the canvas, and frees what it holds. */
  unconfigure(): void;
}

/** One frame to draw on a canvas. */
export interface CanvasFrame extends Pick<FrameRequest, 'camera' | 'levers'> {
  readonly surface: Surface;
  /** The picture is read in the same task. */
  readonly isRead?: boolean;
}

/** How frames are drawn. */
export interface Rendering {
  readonly quality: Quality;
  /** Spherical harmonics above this degree are not evaluated. */
  readonly shDegree: ShDegree;
}

/**
 * A scene on the GPU: its splats, the renderer that draws them (whose buffers fit this scene and this picture size,
 * and so cannot be shared), and the lease that keeps the device.
 */
export class GpuScene {
  readonly renderer = 'webgpu';
  readonly bounds: SceneBounds;
  #gaussians: OwnedGaussians;
  /** The generator or sequence that writes the Gaussians; undefined for those of a file. */
  readonly live: Timeline | undefined;
  /** Called when the frame just drawn lacked something that the next one will have. */
  onIncomplete: () => void = () => undefined;
  /** Called with `out-of-memory/allocation` where a later frame than the first needs more memory than there is. */
  onError: (error: GaussianSplatError) => void = () => undefined;
  #renderer: Renderer;
  #rendering: Rendering = { quality: 'default', shDegree: 3 };
  #filter: FrameFilter | undefined;
  readonly #submissions: number;
  readonly #lease: DeviceLease;
  readonly #clock: QueueClock;
  #detail: DetailLevers;
  #levels: OwnedLevels | undefined;
  #destroyed = false;
  #isPrepared = false;
  /** Size of the last frame; empty if the next one may need other buffers, whatever its size. */
  #drawnSize = '';

  constructor(
    lease: DeviceLease,
    gaussians: OwnedGaussians,
    bounds: SceneBounds,
    submissions: number,
    { live, detail = {} }: { live?: Timeline; detail?: DetailLevers } = {},
  ) {
    this.#lease = lease;
    this.#detail = detail;
    this.live = live;
    this.#gaussians = gaussians;
    this.bounds = bounds;
    this.#submissions = submissions;
    this.#renderer = this.#makeRenderer();
    this.#clock = QueueClock.of(lease.device);
    if (live) this.#clock.isShared = true;
  }

  /** Bytes of GPU memory that frames are drawn with, the splats not counted. */
  get frameBytes(): number {
    return this.#renderer.byteLength + (this.#filter?.byteLength ?? 0);
  }

  /** Its splats. */
  get gaussians(): OwnedGaussians {
    return this.#gaussians;
  }

  /** Levels of detail that were built of its splats. */
  get levels(): OwnedLevels | undefined {
    return this.#levels;
  }

  /** Draws from these levels from now on, or from the splats alone; levels before are freed. */
  setLevels(levels: OwnedLevels | undefined): void {
    if (levels === this.#levels) return;
    this.#levels?.destroy();
    this.#levels = levels;
    this.#drawnSize = '';
    this.#filter?.invalidate();
  }

  /** How much detail is drawn, at rest too. */
  get detail(): DetailLevers {
    return this.#detail;
  }

  setDetail(detail: DetailLevers): void {
    this.#detail = detail;
  }

  /** True for a scene whose file brings levels of detail, all at once or page by page. */
  get hasOwnLevels(): boolean {
    return this.gaussians.pages.some(({ details }) => details !== undefined);
  }

  /** Draws other splats from now on; levels that were built of those before are freed, and so are these. */
  replaceGaussians(gaussians: OwnedGaussians): void {
    this.setLevels(undefined);
    this.#gaussians.destroy();
    this.#gaussians = gaussians;
    this.#drawnSize = '';
    this.#filter?.invalidate();
  }

  get device(): GPUDevice {
    return this.#lease.device;
  }

  /** The canvas's context, set up for the device; null for a canvas of another kind. Premultiplied alpha lets the page show through. */
  surfaceOn(canvas: HTMLCanvasElement): Surface | null {
    const context = canvas.getContext('webgpu');
    const [format, { device }] = [canvasFormat(), this];
    context?.configure({ device, format, usage: canvasUsage(device, format), alphaMode: 'premultiplied' });
    return context;
  }

  get isLost(): boolean {
    return this.#lease.isLost;
  }

  /** Fulfils when the device is lost. */
  get lost(): Promise<GPUDeviceLostInfo> {
    return this.#lease.lost;
  }

  /** Whether the device was lost before all that was submitted was done. */
  async wasLost(): Promise<boolean> {
    await this.device.queue.onSubmittedWorkDone().catch(() => undefined);
    // The loss is told a little later.
    await new Promise((resolve) => setTimeout(resolve));
    return this.isLost;
  }

  get isDestroyed(): boolean {
    return this.#destroyed;
  }

  /** Draws the frames to come like this. */
  setRendering(rendering: Rendering): void {
    const { quality, shDegree } = this.#rendering;
    if (rendering.quality === quality && rendering.shDegree === shDegree) return;
    this.#rendering = rendering;
    this.#renderer.destroy();
    this.#renderer = this.#makeRenderer();
    this.#drawnSize = '';
  }

  /** What stands between the renderer and the canvas; undefined for frames as they are drawn. */
  get filter(): FrameFilter | undefined {
    return this.#filter;
  }

  /** The scene closes its filter when it gets another one, and when it is destroyed. */
  setFilter(filter: FrameFilter | undefined): void {
    this.#filter?.close();
    this.#filter = filter;
    if (filter) this.#clock.isShared = true;
    this.#drawnSize = '';
  }

  #makeRenderer(): Renderer {
    this.#isPrepared = false;
    const onIncomplete = (): void => {
      this.#drawnSize = '';
      this.#filter?.invalidate();
      this.onIncomplete();
    };
    return new Renderer(this.device, { ...this.#rendering, submissions: this.#submissions, onIncomplete });
  }

  /** True if there is what frames with other levers need. */
  get isPrepared(): boolean {
    return this.#isPrepared;
  }

  /** Makes what frames with other levers need, so that none of them has to. */
  prepare(levers: readonly Partial<FrameLevers>[]): void {
    if (this.isLost || this.#destroyed) return;
    this.#isPrepared = true;
    this.#renderer.prepare(levers, canvasFormat());
  }

  /**
   * Encodes and submits one frame.
   * @param onTime gets how long the frame kept the GPU, some frames later
   */
  render(request: CanvasFrame, onTime?: (time: WorkTime) => void): void {
    const frame = frameOf(request);
    const size = sizeOf(frame);
    if (size === this.#drawnSize) return this.#renderOnce(frame, onTime);
    this.#drawnSize = size;
    void this.#withRefusal(() => this.#renderOnce(frame, onTime)).then(async (error) => {
      if (error === null || this.#destroyed) return;
      this.onError(await why(({ noMemory }) => noMemory(`frame of ${size} pixels`, error)));
    });
  }

  #renderOnce(frame: Frame, onTime: ((time: WorkTime) => void) | undefined): void {
    // A lost device has been noticed elsewhere.
    if (onTime) this.#clock.time(() => this.#draw(frame)).then(onTime, () => undefined);
    else this.#draw(frame);
  }

  #draw(frame: Frame): void {
    const { splatBudget } = this.#detail;
    // Whichever leaves out more: what the page asks for, or the pace.
    const detail = Math.max(this.#detail.detail ?? 0, frame.levers?.detail ?? 0);
    const gaussians = this.#levels ?? this.gaussians;
    const draw = (drawn: Frame): void => this.#renderer.render({ ...drawn, detail, splatBudget, gaussians });
    const { quality, shDegree } = this.#rendering;
    const content = `${gaussians.version} ${quality} ${shDegree} ${detail} ${JSON.stringify(frame.levers ?? null)}`;
    if (this.#filter) this.#filter.render(frame, content, draw);
    else draw(frame);
  }

  /**
   * Renders the first frame, for which the renderer allocates its buffers, and waits until the GPU has finished it.
   * @throws GaussianSplatError `out-of-memory/allocation`: WebGPU tells of a failed allocation only through a scope.
   */
  async renderFirst(request: CanvasFrame): Promise<void> {
    const frame = frameOf(request);
    this.#drawnSize = sizeOf(frame);
    const error = await this.#withRefusal(() => this.#draw(frame));
    if (error !== null) throw await why(({ noMemory }) => noMemory('first frame', error));
    await this.device.queue.onSubmittedWorkDone().catch(() => undefined);
    // The GPU has nothing to do now. Nobody waits for it.
    this.#clock.calibrate().catch(() => undefined);
  }

  /** Fulfils with what the device says if memory was lacking for some work. */
  #withRefusal(work: () => void): Promise<GPUError | null> {
    const { device } = this;
    // A lost device closes no scopes; its loss is reported elsewhere.
    const refusal = (): Promise<GPUError | null> => device.popErrorScope().catch(() => null);
    device.pushErrorScope('out-of-memory');
    try {
      work();
    } catch (error) {
      void refusal();
      throw error;
    }
    return refusal();
  }

  /** Looks into the last frame: see {@link Renderer.probeDepth}. */
  probe(points: readonly ProbePoint[]): Promise<ProbeAnswer[]> {
    return this.#renderer.probeDepth(points);
  }

  /** Counts of the last frame, and of a view. Reads back from the GPU: for panels, not for frames. */
  async readCounts(camera: Camera): Promise<ReadCounts> {
    const { visible, overflow } = await this.#renderer.readStatistics();
    const { countContributing } = await loadModule('the code that counts splats', () => import('./contributions.js'));
    if (this.#destroyed) throw new Error('the scene is gone');
    const { quality } = this.#rendering;
    const view = { ...this.#detail, gaussians: this.#levels ?? this.gaussians, camera, quality };
    return { drawn: visible, left: overflow, contributed: await countContributing(this.device, view) };
  }

  /** Frees the GPU memory and lets go of the device. */
  destroy(): void {
    if (this.#destroyed) return;
    this.#destroyed = true;
    this.setFilter(undefined);
    this.live?.close();
    this.#renderer.destroy();
    this.#levels?.destroy();
    this.#gaussians.destroy();
    this.#lease.release();
  }
}

/** What the canvas is made of. */
export const canvasFormat = (): GPUTextureFormat => navigator.gpu.getPreferredCanvasFormat();

const frameOf = ({ camera, levers, surface }: CanvasFrame): Frame => ({
  ...{ camera, levers },
  target: (surface as GPUCanvasContext).getCurrentTexture(),
});

/** Compute shaders may then write the canvas itself, where the device lets them. */
function canvasUsage(device: GPUDevice, format: GPUTextureFormat): GPUTextureUsageFlags {
  const { RENDER_ATTACHMENT, STORAGE_BINDING } = GPUTextureUsage;
  const isStorable = format === 'rgba8unorm' || device.features.has('bgra8unorm-storage');
  return isStorable ? RENDER_ATTACHMENT | STORAGE_BINDING : RENDER_ATTACHMENT;
}

const sizeOf = ({ camera: { width, height } }: Frame): string => `${width} x ${height}`;
