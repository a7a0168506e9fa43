import type { GaussianSplatError, ShDegree, SplatFilter } from '@gaussian-splat/core';
import {
  QueueClock,
  Viewpoint,
  type FrameLevers,
  type FrameSettings,
  type Levers,
  type Picture,
  type Quality,
  type WorkTime,
  type World,
} from '@gaussian-splat/renderer';
import type { Frame, FrameFilter } from '../live/frame-filter.js';
import type { DetailLevers, LoadedGaussians } from './loaded-gaussians.js';
import { why } from './request-device.js';

/** How frames are drawn. */
export interface Rendering {
  readonly quality: Quality;
  /** Spherical harmonics above this degree are not evaluated. */
  readonly shDegree: ShDegree;
  readonly order: Levers['order'];
  /** In place of those of the scenes. */
  readonly filter?: SplatFilter | undefined;
}

/** Where frames are drawn: what keeps the device. */
export type Place = Pick<LoadedGaussians, 'device' | 'isLost' | 'submissions'>;

/** What frames show, as of now. */
export interface Contents {
  readonly world: World;
  /** How much detail is drawn, at rest too. */
  readonly levels: DetailLevers;
  /**
   * Called before each frame: puts into the world what is to be drawn.
   * @returns what changes whenever the frame would
   */
  prepareFrame(): string;
  /** Draws what is no splats, before these are drawn over it. @returns where the splats are drawn, as far as that differs */
  drawBeneath?(frame: Frame): Partial<Picture>;
}

/** What a viewport tells. */
export interface ViewportEvents {
  /** The frame just drawn lacked something that the next one will have. */
  readonly onIncomplete: () => void;
  /** A later frame than the first needs more memory than there is: `out-of-memory/allocation`. */
  readonly onError: (error: GaussianSplatError) => void;
}

/** Draws frames on one device: a viewpoint, whose buffers fit the frame's size, and what stands between it and the canvas. */
export class Viewport {
  readonly viewpoint: Viewpoint;
  readonly #place: Place;
  readonly #contents: Contents;
  readonly #events: ViewportEvents;
  readonly #clock: QueueClock;
  #rendering: Rendering = { quality: 'default', shDegree: 3, order: 'center' };
  #filter: FrameFilter | undefined;
  #isDestroyed = false;
  #isPrepared = false;
  /** Size of the last frame; empty if the next one may need other buffers, whatever its size. */
  #drawnSize = '';
  #layout = 0;

  constructor(place: Place, contents: Contents, events: ViewportEvents) {
    this.#place = place;
    this.#contents = contents;
    this.#events = events;
    this.viewpoint = new Viewpoint(place.device, contents.world, {
      settings: this.#settings(),
      onIncomplete: () => {
        this.#drawnSize = '';
        this.#filter?.invalidate();
        events.onIncomplete();
      },
    });
    this.#clock = QueueClock.of(place.device);
  }

  /** Bytes of GPU memory that frames are drawn with, the splats not counted. */
  get byteLength(): number {
    return this.viewpoint.byteLength + (this.#filter?.byteLength ?? 0);
  }

  get device(): GPUDevice {
    return this.#place.device;
  }

  get isDestroyed(): boolean {
    return this.#isDestroyed;
  }

  get isLost(): boolean {
    return this.#place.isLost;
  }

  /** Draws the frames to come like this. */
  setRendering(rendering: Rendering): void {
    const { quality, shDegree, order } = this.#rendering;
    // A filter takes effect with the next frame, whatever draws it.
    this.#rendering = rendering;
    if (rendering.quality === quality && rendering.shDegree === shDegree && rendering.order === order) return;
    this.#isPrepared = false;
    this.viewpoint.settings = this.#settings();
    this.#drawnSize = '';
  }

  /** What stands between the renderer and the canvas; undefined for frames as they are drawn. */
  get filter(): FrameFilter | undefined {
    return this.#filter;
  }

  /** It closes its filter when it gets another one, and when it is destroyed. */
  setFilter(filter: FrameFilter | undefined): void {
    this.#filter?.close();
    this.#filter = filter;
    if (filter) this.#clock.isShared = true;
    this.#drawnSize = '';
  }

  /** Settings of a frame; with levers of motion where there are some. */
  #settings(levers?: Partial<FrameLevers>): FrameSettings {
    const { detail = 0, splatBudget = 0 } = this.#contents.levels;
    const { submissions } = this.#place;
    const { quality, shDegree, order } = this.#rendering;
    // Whichever leaves out more: what the page asks for, or the pace.
    const most = Math.max(detail, levers?.detail ?? 0);
    return { quality, shDegree, order, submissions, ...levers, detail: most, splatBudget };
  }

  /** True if there is what frames with other levers need. */
  get isPrepared(): boolean {
    return this.#isPrepared;
  }

  /** Makes what frames with other levers need, so that none of them has to. */
  prepare(levers: readonly Partial<FrameLevers>[], format: GPUTextureFormat): void {
    if (this.isLost || this.#isDestroyed) return;
    this.#isPrepared = true;
    this.viewpoint.prepare(
      levers.map((each) => this.#settings(each)),
      format,
    );
  }

  /**
   * Encodes and submits one frame.
   * @param content what `Contents.prepareFrame` has just returned
   * @param onTime gets how long the frame kept the GPU, some frames later
   */
  render(frame: Frame, content: string, onTime?: (time: WorkTime) => void): void {
    const size = sizeOf(frame);
    const { layout } = this.#contents.world;
    if (layout === this.#layout && size === this.#drawnSize) return this.#renderOnce(frame, content, onTime);
    this.#drawnSize = size;
    void this.#withRefusal(() => this.#renderOnce(frame, content, onTime)).then(async (error) => {
      const reason = error && (await why(({ outOfMemory }) => outOfMemory(`frame of ${size} pixels`, error)));
      if (reason && !this.#isDestroyed) this.#events.onError(reason);
    });
  }

  #renderOnce(frame: Frame, content: string, onTime: ((time: WorkTime) => void) | undefined): void {
    // A lost device has been noticed elsewhere.
    if (onTime) this.#clock.time(() => this.#draw(frame, content)).then(onTime, () => undefined);
    else this.#draw(frame, content);
  }

  #draw(frame: Frame, content: string): void {
    this.#layout = this.#contents.world.layout;
    const settings = this.#settings(frame.levers);
    const { filter } = this.#rendering;
    const draw = (drawn: Frame): void => {
      const { camera, target, background: over } = drawn;
      this.viewpoint.draw(camera, { target, over, filter, ...this.#contents.drawBeneath?.(drawn) }, settings);
    };
    if (this.#filter) this.#filter.render(frame, `${content} ${filter} ${JSON.stringify(settings)}`, draw);
    else draw(frame);
  }

  /**
   * Renders the first frame, for which the renderer allocates its buffers, and waits until the GPU has finished it.
   * @throws GaussianSplatError `out-of-memory/allocation`: WebGPU tells of a failed allocation only through a scope.
   */
  async renderFirst(frame: Frame, content: string): Promise<void> {
    this.#drawnSize = sizeOf(frame);
    const error = await this.#withRefusal(() => this.#draw(frame, content));
    if (error) throw await why(({ outOfMemory }) => outOfMemory('first frame', error));
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

  /** What it draws at rest. */
  get view(): { readonly world: World; readonly settings: FrameSettings; readonly filter: SplatFilter | undefined } {
    return { world: this.#contents.world, settings: this.#settings(), filter: this.#rendering.filter };
  }

  /** Frees the GPU memory. What it draws is its owner's. */
  destroy(): void {
    if (this.#isDestroyed) return;
    this.#isDestroyed = true;
    this.setFilter(undefined);
    this.viewpoint.destroy();
  }
}

const sizeOf = ({ camera: { width, height } }: Frame): string => `${width} x ${height}`;
