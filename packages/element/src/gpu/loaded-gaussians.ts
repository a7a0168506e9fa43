import type { GaussianScene } from '@gaussian-splat/renderer';
import { QueueClock } from '@gaussian-splat/renderer/tools';
import type { SceneBounds } from '../camera/settings.js';
import type { Timeline } from '../dynamic/dynamic-model.js';
import type { FrameSource, LodSettings, Backend, BackendEvents, Drawable, DeviceOwner } from './backend.js';
import type { DeviceLease } from './shared-device.js';
import { WebGpuBackend } from './webgpu-backend.js';

/** A scene's Gaussians with additional levels of detail, which own only the levels. */
export interface OwnedLevels extends GaussianScene {
  /** Bytes of GPU memory of the levels. */
  readonly byteLength: number;
  destroy(): void;
}

/** Gaussians with one owner. */
export interface OwnedGaussians extends GaussianScene {
  /** Splats of the current frame, if the capacity is larger. */
  readonly frameCount?: number;
  /** Splats of the finest level, if the file has levels of detail. */
  readonly leafCount?: number;
  /** Dropped splats of the file; unknown for a generator. */
  readonly droppedCount?: number;
  readonly byteLength: number;
  destroy(): void;
}

/** Triangles of a source, with or without splats. */
export interface MeshModel {
  readonly triangles: number;
  readonly byteLength: number;
  /** Incremented when its animation has moved it. */
  readonly version: number;
  dispose(): void;
}

/**
 * The GPU content of one source: its splats, their levels of detail, their generator, and the lease that keeps the
 * device.
 */
export class LoadedGaussians implements Drawable {
  /** Its backend. */
  readonly renderer: 'webgpu' | 'webgl' = 'webgpu';
  readonly #bounds: SceneBounds;
  /** The generator or sequence that writes the Gaussians; undefined for those of a file. */
  readonly live: Timeline | undefined;
  /** Number of submissions of a frame. */
  readonly submissions: number;
  /** Its triangles, once they are read. */
  model: MeshModel | undefined;
  /** Sort order of its splats, if its file declares one. */
  readonly order: 'pixel' | undefined;
  /** Whether its file has triangles, too. */
  readonly hasMeshes: boolean;
  /** Messages about content of its file that is not drawn. */
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

  /** For a generator, the bounds of its last runs. */
  get bounds(): SceneBounds {
    return this.live?.bounds ?? this.#bounds;
  }

  get gaussians(): OwnedGaussians {
    return this.#gaussians;
  }

  /** Levels of detail that were built from its splats. */
  get levels(): OwnedLevels | undefined {
    return this.#levels;
  }

  /** The drawn scene: the levels, if there are any, include the splats. */
  get drawn(): GaussianScene {
    return this.#levels ?? this.#gaussians;
  }

  /** Draws with these levels in subsequent frames, or only the splats; frees previous levels. */
  setLevels(levels: OwnedLevels | undefined): void {
    if (levels === this.#levels) return;
    this.#levels?.destroy();
    this.#levels = levels;
  }

  /** LOD settings, also at rest. */
  get detail(): LodSettings {
    return this.#detail;
  }

  setDetail(detail: LodSettings): void {
    this.#detail = detail;
  }

  /** Whether its file has levels of detail, complete or streamed. */
  get hasOwnLevels(): boolean {
    return this.gaussians.pages.some(({ details }) => details !== undefined);
  }

  /** Replaces the splats in subsequent frames; frees the previous ones and their levels. */
  replaceGaussians(gaussians: OwnedGaussians): void {
    this.setLevels(undefined);
    this.#gaussians.destroy();
    this.#gaussians = gaussians;
  }

  /** Creates its backend. */
  openBackend(contents: FrameSource, events: BackendEvents): Backend {
    return new WebGpuBackend(this, contents, events);
  }

  /** @throws GaussianSplatError `unsupported/webgl` without WebGPU. */
  get device(): GPUDevice {
    return this.#lease.device;
  }

  get place(): DeviceOwner {
    return this.#lease;
  }

  get isLost(): boolean {
    return this.#lease.isLost;
  }

  /** Resolves when the device is lost. */
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

  /** Frees the GPU memory and releases the device. */
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
