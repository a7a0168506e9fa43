import { loadModule, type Camera } from '@gaussian-splat/core';
import { Viewpoint, type FrameSettings, type PerFrameSettings } from '@gaussian-splat/renderer';
import { QueueClock, type ProbeAnswer, type ProbePoint, type WorkTime } from '@gaussian-splat/renderer/tools';
import type { Frame, FrameFilter } from '../sources/generator/frame-filter.js';
import type {
  CanvasFrame,
  FrameSource,
  Drawable,
  Backend,
  BackendEvents,
  DeviceOwner,
  ReadCounts,
  Rendering,
  Surface,
} from './backend.js';
import type { Counted } from './contributions.js';
import { why } from './request-device.js';

/**
 * Draws frames on one WebGPU device, with a viewpoint, whose buffers match the frame size, and an optional filter
 * before the canvas.
 */
export class WebGpuBackend implements Backend {
  readonly can: Backend['can'] = () => true;
  readonly viewpoint: Viewpoint;
  readonly device: GPUDevice;
  readonly place: DeviceOwner;
  readonly #submissions: number;
  readonly #contents: FrameSource;
  readonly #events: BackendEvents;
  readonly #clock: QueueClock;
  #rendering: Rendering = { quality: 'default', shDegree: 3, order: 'center' };
  #filter: FrameFilter | undefined;
  #isDestroyed = false;
  #isPrepared = false;
  /** Size and splat budget of the last frame, as text. Empty if the next frame may need other buffers at the same size. */
  #drawnSize = '';
  #layout = 0;

  constructor({ place, submissions }: Drawable, contents: FrameSource, events: BackendEvents) {
    const device = place.context as GPUDevice;
    this.place = place;
    this.device = device;
    this.#submissions = submissions;
    this.#contents = contents;
    this.#events = events;
    this.viewpoint = new Viewpoint(device, contents.sources.world, {
      settings: this.#settings(),
      limitsOverdraw: true,
      onIncomplete: () => {
        this.#drawnSize = '';
        this.#filter?.invalidate();
        events.onIncomplete();
      },
    });
    this.#clock = QueueClock.of(device);
  }

  get byteLength(): number {
    return this.viewpoint.byteLength + (this.#filter?.byteLength ?? 0);
  }

  get pixelShare(): number {
    return this.viewpoint.pixelShare;
  }

  get isDestroyed(): boolean {
    return this.#isDestroyed;
  }

  setRendering(rendering: Rendering): void {
    const { quality, shDegree, order } = this.#rendering;
    // A change of the low-pass filter alone needs no other buffers or pipelines.
    this.#rendering = rendering;
    if (rendering.quality === quality && rendering.shDegree === shDegree && rendering.order === order) return;
    this.#isPrepared = false;
    this.viewpoint.settings = this.#settings();
    this.#drawnSize = '';
  }

  get filter(): FrameFilter | undefined {
    return this.#filter;
  }

  setFilter(filter: FrameFilter | undefined): void {
    this.#filter?.close();
    this.#filter = filter;
    if (filter) this.#clock.isShared = true;
    this.#drawnSize = '';
  }

  /** Returns the settings of a frame. `settings` are those of frames in motion; undefined at rest. */
  #settings(settings?: Partial<PerFrameSettings>): FrameSettings {
    const { detail = 0, splatBudget = 0 } = this.#contents.sources.levels;
    const { quality, shDegree, order } = this.#rendering;
    // The allowed error is the larger one of the page's setting and of dynamic quality.
    const max = Math.max(detail, settings?.detail ?? 0);
    return {
      quality,
      shDegree,
      order,
      submissions: this.#submissions,
      ...settings,
      ...this.#filter?.settings,
      detail: max,
      splatBudget,
    };
  }

  get isPrepared(): boolean {
    return this.#isPrepared;
  }

  prepare(settings: readonly Partial<PerFrameSettings>[]): void {
    if (this.place.isLost || this.#isDestroyed) return;
    this.#isPrepared = true;
    this.viewpoint.prepare(
      settings.map((each) => this.#settings(each)),
      canvasFormat(),
    );
  }

  /**
   * Returns the context of a canvas, configured with premultiplied alpha, so that the page is visible behind the splats.
   * Null if the canvas has a context of another kind, or the browser has no WebGPU.
   */
  surfaceOn(canvas: HTMLCanvasElement): Surface | null {
    const context = canvas.getContext('webgpu');
    const [format, { device }] = [canvasFormat(), this];
    context?.configure({ device, format, usage: canvasUsage(device, format), alphaMode: 'premultiplied' });
    return context;
  }

  render(request: CanvasFrame, content: string, onTime?: (time: WorkTime) => void): void {
    const frame = frameOf(request);
    const size = this.#sizeOf(frame);
    const { layout } = this.#contents.sources.world;
    if (layout === this.#layout && size === this.#drawnSize) return this.#renderOnce(frame, content, onTime);
    this.#drawnSize = size;
    void this.#withRefusal(() => this.#renderOnce(frame, content, onTime)).then(async (error) => {
      const reason = error && (await why(({ outOfMemory }) => outOfMemory(`frame of ${size} splats`, error)));
      if (reason && !this.#isDestroyed) this.#events.onError(reason);
    });
  }

  #sizeOf({ camera: { width, height } }: Frame): string {
    return `${width} x ${height} pixels, ${this.#contents.sources.levels.splatBudget}`;
  }

  #renderOnce(frame: Frame, content: string, onTime: ((time: WorkTime) => void) | undefined): void {
    // Other code detects a lost device.
    if (onTime) this.#clock.time(() => this.#draw(frame, content)).then(onTime, () => undefined);
    else this.#draw(frame, content);
  }

  #draw(frame: Frame, content: string): void {
    this.#layout = this.#contents.sources.world.layout;
    const settings = this.#settings(frame.settings);
    const { filter } = this.#rendering;
    const draw = (drawn: Frame): void => {
      const { camera, target, background: over, depth } = drawn;
      this.viewpoint.draw(
        camera,
        { target, background: over, filter, depth, ...this.#contents.drawBeneath?.(drawn) },
        settings,
      );
    };
    if (this.#filter) this.#filter.render(frame, `${content} ${filter} ${JSON.stringify(settings)}`, draw);
    else draw(frame);
  }

  /**
   * Renders the first frame, which makes the renderer allocate its buffers, and waits until the GPU has finished it.
   * @throws GaussianSplatError `out-of-memory/allocation`. WebGPU reports a failed allocation only through an error
   * scope.
   */
  async renderFirst(request: CanvasFrame, content: string): Promise<void> {
    const frame = frameOf(request);
    this.#drawnSize = this.#sizeOf(frame);
    const error = await this.#withRefusal(() => this.#draw(frame, content));
    if (error) throw await why(({ outOfMemory }) => outOfMemory('first frame', error));
    await this.finished();
    // The clock is calibrated while the GPU is idle. The result is not awaited.
    this.#clock.calibrate().catch(() => undefined);
  }

  /**
   * Runs work that allocates GPU memory. Resolves with the device's error if the memory was insufficient, otherwise
   * with null.
   */
  #withRefusal(work: () => void): Promise<GPUError | null> {
    const { device } = this;
    // A lost device does not resolve error scopes; other code reports its loss.
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

  async probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]> {
    // The buffers of the last frame are freed when other splats replace its scene.
    if (this.#contents.sources.world.layout !== this.#layout) return [];
    return this.viewpoint.probe(points);
  }

  async readCounts(camera: Camera): Promise<ReadCounts> {
    const { readCounts } = await loadModule('the code that counts splats', () => import('./contributions.js'));
    return readCounts(this, camera);
  }

  /** World, settings and filter of frames at rest. */
  get view(): Counted['view'] {
    return { world: this.#contents.sources.world, settings: this.#settings(), filter: this.#rendering.filter };
  }

  /** Resolves when all submitted work is done, or the device is lost. */
  finished(): Promise<unknown> {
    return this.device.queue.onSubmittedWorkDone().catch(() => undefined);
  }

  destroy(): void {
    if (this.#isDestroyed) return;
    this.#isDestroyed = true;
    this.setFilter(undefined);
    this.viewpoint.destroy();
  }
}

let format: GPUTextureFormat | undefined;
/** Returns the preferred format of canvases, which is the same for all of a browser and is read once. */
export const canvasFormat = (): GPUTextureFormat => (format ??= navigator.gpu.getPreferredCanvasFormat());

const frameOf = ({ surface, ...frame }: CanvasFrame): Frame => ({
  ...frame,
  target: (surface as GPUCanvasContext).getCurrentTexture(),
});

/**
 * Returns the usage of the canvas's textures. Frames can be copied, and compute shaders may write to the canvas
 * directly if the device supports it.
 */
function canvasUsage(device: GPUDevice, format: GPUTextureFormat): GPUTextureUsageFlags {
  const { COPY_SRC, RENDER_ATTACHMENT, STORAGE_BINDING } = GPUTextureUsage;
  const isStorable = format === 'rgba8unorm' || device.features.has('bgra8unorm-storage');
  return COPY_SRC | RENDER_ATTACHMENT | (isStorable ? STORAGE_BINDING : 0);
}
