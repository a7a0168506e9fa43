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
import type { Frame, FrameFilter } from '../sources/generator/frame-filter.js';
import type { Content } from '../sources/content.js';

/** Settings of all frames of an element. */
export interface Rendering {
  readonly quality: Quality;
  /** Maximum degree of spherical harmonics that is evaluated, 0..3. */
  readonly shDegree: ShDegree;
  readonly order: RenderSettings['order'];
  /** Low-pass filter of the splats, instead of the scenes' own; undefined to use theirs. */
  readonly filter?: SplatFilter | undefined;
}

/** Allowed error in pixels, and maximum number of splats, for scenes with levels of detail. */
export interface LodSettings extends Pick<FrameSettings, 'detail' | 'splatBudget'> {
  /** Smallest and largest `splatBudget`, within which it follows the time of frames. Absent for a fixed one. */
  readonly splatRange?: readonly [number, number];
}

/** Counts of the splats of a frame, which are read back from the GPU. */
export interface ReadCounts {
  readonly drawn: number;
  /** Number of visible splats that are not drawn, because they exceed the capacity of the buffers. */
  readonly left: number;
  /** Number of splats that contribute visibly to some pixel; null with WebGL, which does not count them. */
  readonly contributing: number | null;
}

/** The device on which frames are drawn, and its state. */
export interface DeviceOwner {
  /** The GPU context. Scenes with the same context share a backend. */
  readonly context: GPUDevice | WebGL2RenderingContext;
  readonly limits: { readonly maxTextureDimension2D: number };
  /** Ledger of the GPU memory of all scenes on the device. */
  readonly memory: MemoryLedger;
  readonly isLost: boolean;
  readonly lost: Promise<GPUDeviceLostInfo>;
}

/** A scene that can be drawn, with its device and backend. */
export interface Drawable {
  readonly place: DeviceOwner;
  /** Number of submissions into which the work of a frame is divided. */
  readonly submissions: number;
  /** Returns whether the backend can draw a content: see {@link Backend.can}. */
  can(content: Content): boolean;
  /** Creates a backend that draws on the device of this scene. */
  openBackend(contents: FrameSource, events: BackendEvents): Backend;
}

/** Provides the current content of frames. */
export interface FrameSource {
  readonly sources: {
    readonly world: World;
    /** Settings of the levels of detail of all frames, also at rest. */
    readonly levels: LodSettings;
  };
  /**
   * Updates the world. Called before each frame.
   * @returns A key of the content, which changes whenever the frame would differ.
   */
  prepareFrame(): string;
  /**
   * Draws meshes, before the splats are drawn over them. @returns Properties of the target of the splats that differ
   * from those of the frame.
   */
  drawBeneath?(frame: Frame): Partial<FrameTarget>;
}

/** Listeners of a backend. */
export interface BackendEvents {
  /**
   * Called after a frame with missing splats, because its buffers were too small. The next frame has larger buffers.
   */
  readonly onIncomplete: () => void;
  /** Called with `out-of-memory/allocation` if a frame after the first needs more memory than is available. */
  readonly onError: (error: GaussianSplatError) => void;
}

/** The context of a canvas on which backends of one kind draw. */
export interface Surface {
  readonly canvas: HTMLCanvasElement | OffscreenCanvas;
  /** Clears the canvas, and frees the resources of the context. */
  unconfigure(): void;
}

/** Parameters of a frame that is drawn on a canvas. */
export interface CanvasFrame {
  readonly camera: Camera;
  readonly surface: Surface;
  /** Premultiplied color behind the splats. */
  readonly background?: Rgba | undefined;
  /** Settings in which the frame differs from frames at rest. */
  readonly settings?: Partial<PerFrameSettings> | undefined;
  /** Whether a script reads the canvas in the same task. */
  readonly isRead?: boolean;
}

/** Draws frames on canvases: `WebGpuBackend` or `WebGlBackend`. */
export interface Backend {
  readonly place: DeviceOwner;
  /** Returns whether the backend can draw a content. Its class has the same function, which is asked before a load. */
  can(content: Content): boolean;
  /** @throws GaussianSplatError `unsupported/webgl` without WebGPU. */
  readonly device: GPUDevice;
  /** GPU memory for drawing in bytes, without that of the splats. */
  readonly byteLength: number;
  /** Factor of the width and of the height, 0..1, by which frames are reduced to limit overdraw. */
  readonly pixelShare: number;
  readonly isDestroyed: boolean;
  /** Whether {@link prepare} was called for the current settings. */
  readonly isPrepared: boolean;
  /** Filter between the renderer and the canvas; undefined for unprocessed frames. */
  readonly filter: FrameFilter | undefined;
  /**
   * Sets the filter of subsequent frames, and closes the previous one. Destroying the backend closes the current
   * filter.
   */
  setFilter(filter: FrameFilter | undefined): void;
  /** Sets quality, order and filter of subsequent frames. */
  setRendering(rendering: Rendering): void;
  /** Compiles the pipelines for other settings, so that frames with these settings need not wait. */
  prepare(settings: readonly Partial<PerFrameSettings>[]): void;
  /**
   * Configures the context of a canvas for drawing, and returns it; null if the canvas already has another kind of
   * context.
   */
  surfaceOn(canvas: HTMLCanvasElement): Surface | null;
  /**
   * Encodes and submits one frame.
   * @param content The last result of `FrameSource.prepareFrame`.
   * @param onTime Called with the GPU time of the frame, some frames later.
   */
  render(frame: CanvasFrame, content: string, onTime?: (time: WorkTime) => void): void;
  /**
   * Renders the first frame, and waits until the GPU has finished it.
   * @throws GaussianSplatError `out-of-memory/allocation`
   */
  renderFirst(frame: CanvasFrame, content: string): Promise<void>;
  /** Returns the transmittance in front of points of the last frame: see `Viewpoint.probe`. */
  probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]>;
  /**
   * Returns the counts of the last frame, and of the view of a camera. Reads back from the GPU, so call it for
   * statistics only, not in each frame.
   */
  readCounts(camera: Camera): Promise<ReadCounts>;
  /** Resolves when the GPU has finished all submitted work, or is lost. */
  finished(): Promise<unknown>;
  /** Frees the GPU memory, except that of the scenes, which their owners free. */
  destroy(): void;
}
