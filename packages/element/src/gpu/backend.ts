import type { Camera, GaussianSplatError, ShDegree, SplatFilter } from '@gaussian-splat/core';
import type {
  FrameSettings,
  MemoryLedger,
  PerFrameSettings,
  RenderSettings,
  FrameTarget,
  Quality,
  Rgba,
  World,
} from '@gaussian-splat/renderer';
import type { ProbeAnswer, ProbePoint, WorkTime } from '@gaussian-splat/renderer/tools';
import type { Frame, FrameFilter } from '../dynamic/frame-filter.js';

/** Settings of frames. */
export interface Rendering {
  readonly quality: Quality;
  /** Maximum degree of spherical harmonics to evaluate. */
  readonly shDegree: ShDegree;
  readonly order: RenderSettings['order'];
  /** Overrides those of the scenes. */
  readonly filter?: SplatFilter | undefined;
}

/** LOD settings for scenes with levels of detail. */
export type LodSettings = Pick<FrameSettings, 'detail' | 'splatBudget'>;

/** Counts that are read back from the GPU. */
export interface ReadCounts {
  readonly drawn: number;
  /** Visible splats beyond the capacity of the device's buffers. */
  readonly left: number;
  /** null with WebGL, which does not count it. */
  readonly contributed: number | null;
}

/** Owner of a device, on which frames are drawn. */
export interface DeviceOwner {
  /** The GPU context: owners with the same one share a backend. */
  readonly context: GPUDevice | WebGL2RenderingContext;
  readonly limits: { readonly maxTextureDimension2D: number };
  /** GPU memory of the scenes. */
  readonly memory: MemoryLedger;
  readonly isLost: boolean;
  readonly lost: Promise<GPUDeviceLostInfo>;
}

/** A scene that can be drawn, with its device and backend. */
export interface Drawable {
  readonly place: DeviceOwner;
  /** @throws GaussianSplatError `unsupported/webgl` without WebGPU. */
  readonly device: GPUDevice;
  /** Number of submissions of a frame. */
  readonly submissions: number;
  /** Creates a backend for its device. */
  openBackend(contents: FrameSource, events: BackendEvents): Backend;
}

/** Current content of frames. */
export interface FrameSource {
  readonly world: World;
  /** LOD settings, also at rest. */
  readonly levels: LodSettings;
  /**
   * Called before each frame: updates the world.
   * @returns A key that changes whenever the frame would.
   */
  prepareFrame(): string;
  /** Draws meshes, before splats are drawn over them. @returns Overrides of the target for the splats. */
  drawBeneath?(frame: Frame): Partial<FrameTarget>;
}

/** Events of a backend. */
export interface BackendEvents {
  /** The last frame was incomplete; the next one will not be. */
  readonly onIncomplete: () => void;
  /** A later frame than the first needs more memory than available: `out-of-memory/allocation`. */
  readonly onError: (error: GaussianSplatError) => void;
}

/** Surface of a canvas: a context for backends of one kind. */
export interface Surface {
  readonly canvas: HTMLCanvasElement | OffscreenCanvas;
  /** Clears the canvas, and frees its resources. */
  unconfigure(): void;
}

/** One frame to draw on a canvas. */
export interface CanvasFrame {
  readonly camera: Camera;
  readonly surface: Surface;
  /** Premultiplied. */
  readonly background?: Rgba | undefined;
  /** Settings that differ from those at rest. */
  readonly settings?: Partial<PerFrameSettings> | undefined;
  /** Whether the frame is read in the same task. */
  readonly isRead?: boolean;
}

/** Draws frames on canvases: `WebGpuBackend` or `WebGlBackend`. */
export interface Backend {
  readonly place: DeviceOwner;
  /** @throws GaussianSplatError `unsupported/webgl` without WebGPU. */
  readonly device: GPUDevice;
  /** Bytes of GPU memory for drawing, without the splats. */
  readonly byteLength: number;
  /** Resolution scale of each side that the overdraw limit requires, 0..1. */
  readonly pixelShare: number;
  readonly isDestroyed: boolean;
  readonly isLost: boolean;
  /** Whether the pipelines for other settings are compiled. */
  readonly isPrepared: boolean;
  /** Filter between the renderer and the canvas; undefined for unprocessed frames. */
  readonly filter: FrameFilter | undefined;
  /** Closes the previous filter; destroying the backend closes the current one. */
  setFilter(filter: FrameFilter | undefined): void;
  /** Sets the settings of subsequent frames. */
  setRendering(rendering: Rendering): void;
  /** Compiles the pipelines for other settings, so that no frame has to. */
  prepare(settings: readonly Partial<PerFrameSettings>[]): void;
  /** Configures the canvas's context for drawing; null for a canvas of another kind. */
  surfaceOn(canvas: HTMLCanvasElement): Surface | null;
  /**
   * Encodes and submits one frame.
   * @param content The last result of `FrameSource.prepareFrame`.
   * @param onTime Is called with the GPU time of the frame, some frames later.
   */
  render(frame: CanvasFrame, content: string, onTime?: (time: WorkTime) => void): void;
  /**
   * Renders the first frame, and waits until the GPU has finished it.
   * @throws GaussianSplatError `out-of-memory/allocation`
   */
  renderFirst(frame: CanvasFrame, content: string): Promise<void>;
  /** Probes the last frame: see `Viewpoint.probe`. */
  probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]>;
  /** Reads the counts of the last frame, and of a view. Reads back from the GPU: for panels, not for frames. */
  readCounts(camera: Camera): Promise<ReadCounts>;
  /** Resolves when the GPU has finished all submitted work, or is lost. */
  finished(): Promise<unknown>;
  /** Frees the GPU memory, except that of the scenes, which their owners free. */
  destroy(): void;
}
