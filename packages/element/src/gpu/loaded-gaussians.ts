import type { Credits, TrainedOrder } from '@gaussian-splat/core';
import type { GaussianScene, StreamProgress } from '@gaussian-splat/renderer';
import { QueueClock } from '@gaussian-splat/renderer/tools';
import type { SceneBounds } from '../viewer/camera/settings.js';
import type { SceneGroups } from '../loading/protocol.js';
import type { Timeline } from '../sources/generator/dynamic-model.js';
import type { FrameSource, LodSettings, Backend, BackendEvents, Drawable } from './backend.js';
import type { DeviceLease } from './shared-device.js';
import { WebGpuBackend } from './webgpu-backend.js';

/** A scene's Gaussians with additional levels of detail. The object owns only the levels, not the Gaussians. */
export interface OwnedLevels extends GaussianScene {
  /** GPU memory of the levels, bytes. */
  readonly byteLength: number;
  destroy(): void;
}

/** Gaussians on the GPU, which their owner must destroy. */
export interface OwnedGaussians extends GaussianScene {
  /** Number of splats in the current frame; absent if it always equals the capacity. */
  readonly frameCount?: number;
  /** Number of splats in the finest level; absent if the file has no levels of detail. */
  readonly leafCount?: number;
  /** Number of splats of the file that were dropped as unusable; absent for a generator. */
  readonly droppedCount?: number;
  /** Pages on the GPU of a streamed scene. */
  readonly progress?: StreamProgress;
  readonly byteLength: number;
  destroy(): void;
}

/** Triangle meshes of a source, which may also have splats. */
export interface MeshModel {
  readonly triangles: number;
  readonly byteLength: number;
  /** Counter that is incremented when an animation has moved the meshes. */
  readonly version: number;
  dispose(): void;
}

/**
 * The GPU content of one source: its splats, their levels of detail, and their generator. It holds the lease of the
 * device.
 */
export class LoadedGaussians implements Drawable {
  /** Kind of backend that draws the scene. */
  readonly renderer: 'webgpu' | 'webgl' = 'webgpu';
  /** Levels of detail would merge splats of different groups. */
  readonly can: Backend['can'] = (content) => content !== 'levels' || !this.groups;
  readonly #bounds: SceneBounds;
  /** The generator, sequence or clip that writes the Gaussians; undefined for those of a file. */
  readonly live: Timeline | undefined;
  /** Number of submissions into which the work of a frame is divided. */
  readonly submissions: number;
  /** The meshes of the source; undefined until they are read, and if there are none. */
  model: MeshModel | undefined;
  /** Sort order of the splats that the file declares; undefined if it declares none. */
  readonly order: TrainedOrder | undefined;
  /** Whether the file also contains triangle meshes. */
  readonly hasMeshes: boolean;
  /** Credits that the file, the manifest or the contract declares. */
  readonly credits: Credits | undefined;
  /** Groups of the splats; undefined if the file has none, or the page does not ask for them. */
  readonly groups: SceneGroups | undefined;
  /** Messages about content of the file that is not drawn. */
  warnings: readonly string[];
  /** Called when another frame is required: a part has arrived, or a view has no feedback pass yet. */
  onChange: () => void = () => undefined;
  /** Lease of the device, which is released with the scene. */
  readonly place: DeviceLease;
  #gaussians: OwnedGaussians;
  #levels: OwnedLevels | undefined;
  #detail: LodSettings;
  readonly #life = new AbortController();
  /** Signal that is aborted when the scene is destroyed. */
  readonly signal = this.#life.signal;

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
      credits,
      groups,
    }: {
      live?: Timeline | undefined;
      detail?: LodSettings;
      order?: TrainedOrder | undefined;
      hasMeshes?: boolean | undefined;
      warnings?: readonly string[] | undefined;
      credits?: Credits | undefined;
      groups?: SceneGroups | undefined;
    } = {},
  ) {
    this.place = lease;
    this.#gaussians = gaussians;
    this.#bounds = bounds;
    this.submissions = submissions;
    this.live = live;
    this.#detail = detail;
    this.order = order;
    this.hasMeshes = hasMeshes;
    this.warnings = warnings;
    this.credits = credits ?? live?.credits;
    this.groups = groups;
    if (live) QueueClock.of(lease.device).isShared = true;
  }

  /**
   * Bounds of the splats in scene coordinates: those that the generator or sequence reports, otherwise those of the
   * file.
   */
  get bounds(): SceneBounds {
    return this.live?.bounds ?? this.#bounds;
  }

  get gaussians(): OwnedGaussians {
    return this.#gaussians;
  }

  /** Levels of detail that were built from the splats; undefined if there are none. */
  get levels(): OwnedLevels | undefined {
    return this.#levels;
  }

  /** The scene that is drawn. If levels were built, it is the levels, which include the splats. */
  get drawn(): GaussianScene {
    return this.#levels ?? this.#gaussians;
  }

  /** Sets the levels of subsequent frames; undefined to draw only the splats. Frees the previous levels. */
  setLevels(levels: OwnedLevels | undefined): void {
    if (levels === this.#levels) return;
    this.#levels?.destroy();
    this.#levels = levels;
  }

  /** Settings of the levels of detail, also at rest. */
  get detail(): LodSettings {
    return this.#detail;
  }

  setDetail(detail: LodSettings): void {
    this.#detail = detail;
  }

  /** Whether the file contains levels of detail, complete or streamed. */
  get hasOwnLevels(): boolean {
    return this.gaussians.blocks.some(({ details }) => details !== undefined);
  }

  /** Replaces the splats in subsequent frames. Frees the previous splats and their levels. */
  replaceGaussians(gaussians: OwnedGaussians): void {
    this.setLevels(undefined);
    this.#gaussians.destroy();
    this.#gaussians = gaussians;
  }

  /** Creates a backend on the device of the scene. */
  openBackend(contents: FrameSource, events: BackendEvents): Backend {
    return new WebGpuBackend(this, contents, events);
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
    this.place.release();
  }
}
