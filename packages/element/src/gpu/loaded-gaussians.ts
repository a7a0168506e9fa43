import type { GaussianScene } from '@gaussian-splat/renderer';
import { QueueClock } from '@gaussian-splat/renderer/tools';
import type { SceneBounds } from '../camera/settings.js';
import type { Timeline } from '../live/live-model.js';
import type { Contents, LodSettings, Painter, PainterEvents, Drawable, Place } from './painter.js';
import type { DeviceLease } from './shared-device.js';
import { Viewport } from './viewport.js';

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

/** Triangles that a source has besides its splats, or in place of them. */
export interface MeshModel {
  readonly triangles: number;
  readonly byteLength: number;
  /** Grows when it has moved by itself. */
  readonly version: number;
  dispose(): void;
}

/** What one source has on the GPU: its splats, levels of detail of them, what writes them, and the lease that keeps the device. */
export class LoadedGaussians implements Drawable {
  /** What draws it. */
  readonly renderer: 'webgpu' | 'webgl' = 'webgpu';
  readonly #bounds: SceneBounds;
  /** The generator or sequence that writes the Gaussians; undefined for those of a file. */
  readonly live: Timeline | undefined;
  /** Submissions that the painting of a frame is divided into. */
  readonly submissions: number;
  /** Its triangles, once they are read. */
  model: MeshModel | undefined;
  /** What its splats are ordered by, where its file tells. */
  readonly order: 'pixel' | undefined;
  /** Its file has triangles, too. */
  readonly hasMeshes: boolean;
  /** What of its file is not drawn, for people. */
  warnings: readonly string[];
  /** Called when the next frame would show more than the last one. */
  onChange: () => void = () => undefined;
  readonly #lease: DeviceLease;
  #gaussians: OwnedGaussians;
  #levels: OwnedLevels | undefined;
  #detail: LodSettings;
  readonly #life = new AbortController();

  constructor(
    lease: DeviceLease,
    gaussians: OwnedGaussians,
    bounds: SceneBounds,
    submissions: number,
    {
      live,
      detail = {},
      order,
      hasMeshes = false,
      warnings = [],
    }: {
      live?: Timeline | undefined;
      detail?: LodSettings;
      order?: 'pixel' | undefined;
      hasMeshes?: boolean | undefined;
      warnings?: readonly string[] | undefined;
    } = {},
  ) {
    this.#lease = lease;
    this.#gaussians = gaussians;
    this.#bounds = bounds;
    this.submissions = submissions;
    this.live = live;
    this.#detail = detail;
    this.order = order;
    this.hasMeshes = hasMeshes;
    this.warnings = warnings;
    if (live) QueueClock.of(lease.device).isShared = true;
  }

  /** Of a generator, those of its last runs. */
  get bounds(): SceneBounds {
    return this.live?.bounds ?? this.#bounds;
  }

  get gaussians(): OwnedGaussians {
    return this.#gaussians;
  }

  /** Levels of detail that were built of its splats. */
  get levels(): OwnedLevels | undefined {
    return this.#levels;
  }

  /** What is drawn of it: the levels, where there are some, hold the splats, too. */
  get drawn(): GaussianScene {
    return this.#levels ?? this.#gaussians;
  }

  /** Draws from these levels from now on, or from the splats alone; levels before are freed. */
  setLevels(levels: OwnedLevels | undefined): void {
    if (levels === this.#levels) return;
    this.#levels?.destroy();
    this.#levels = levels;
  }

  /** How much detail is drawn, at rest too. */
  get detail(): LodSettings {
    return this.#detail;
  }

  setDetail(detail: LodSettings): void {
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
  }

  /** What draws frames where it is. */
  openPainter(contents: Contents, events: PainterEvents): Painter {
    return new Viewport(this, contents, events);
  }

  /** @throws GaussianSplatError `unsupported/webgl` without WebGPU. */
  get device(): GPUDevice {
    return this.#lease.device;
  }

  get place(): Place {
    return this.#lease;
  }

  get isLost(): boolean {
    return this.#lease.isLost;
  }

  /** Fulfils when the device is lost. */
  get lost(): Promise<GPUDeviceLostInfo> {
    return this.#lease.lost;
  }

  /** Aborted when it is destroyed. */
  get signal(): AbortSignal {
    return this.#life.signal;
  }

  get isDestroyed(): boolean {
    return this.signal.aborted;
  }

  /** Frees the GPU memory and lets go of the device. */
  destroy(): void {
    if (this.isDestroyed) return;
    this.#life.abort();
    this.live?.close();
    this.model?.dispose();
    this.#levels?.destroy();
    this.#gaussians.destroy();
    this.#lease.release();
  }
}
