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
import type { Frame, FrameFilter } from '../live/frame-filter.js';

/** How frames are drawn. */
export interface Rendering {
  readonly quality: Quality;
  /** Spherical harmonics above this degree are not evaluated. */
  readonly shDegree: ShDegree;
  readonly order: RenderSettings['order'];
  /** In place of those of the scenes. */
  readonly filter?: SplatFilter | undefined;
}

/** How much detail is drawn of a scene that has levels of it. */
export type LodSettings = Pick<FrameSettings, 'detail' | 'splatBudget'>;

/** Counts that have to be read back from the GPU. */
export interface ReadCounts {
  readonly drawn: number;
  /** Visible, but without room in what the device allows a buffer to hold. */
  readonly left: number;
  /** null where it is not counted: with WebGL. */
  readonly contributed: number | null;
}

/** Where frames are drawn: what keeps the device, and knows what draws on it. */
export interface Place {
  /** What draws: places with the same one share a painter. */
  readonly context: GPUDevice | WebGL2RenderingContext;
  readonly limits: { readonly maxTextureDimension2D: number };
  /** What scenes hold of its memory. */
  readonly memory: MemoryLedger;
  readonly isLost: boolean;
  readonly lost: Promise<GPUDeviceLostInfo>;
}

/** A scene that is drawn: where, and by what. */
export interface Drawable {
  readonly place: Place;
  /** @throws GaussianSplatError `unsupported/webgl` without WebGPU. */
  readonly device: GPUDevice;
  /** Submissions that the painting of a frame is divided into. */
  readonly submissions: number;
  /** What draws frames on it. */
  openPainter(contents: Contents, events: PainterEvents): Painter;
}

/** What frames show, as of now. */
export interface Contents {
  readonly world: World;
  /** How much detail is drawn, at rest too. */
  readonly levels: LodSettings;
  /**
   * Called before each frame: puts into the world what is to be drawn.
   * @returns what changes whenever the frame would
   */
  prepareFrame(): string;
  /** Draws what is no splats, before these are drawn over it. @returns where the splats are drawn, as far as that differs */
  drawBeneath?(frame: Frame): Partial<FrameTarget>;
}

/** What a painter tells. */
export interface PainterEvents {
  /** The frame just drawn lacked something that the next one will have. */
  readonly onIncomplete: () => void;
  /** A later frame than the first needs more memory than there is: `out-of-memory/allocation`. */
  readonly onError: (error: GaussianSplatError) => void;
}

/** What a canvas shows: a context that painters of one kind draw into. */
export interface Surface {
  readonly canvas: HTMLCanvasElement | OffscreenCanvas;
  /** Clears the canvas, and frees what it holds. */
  unconfigure(): void;
}

/** One frame to draw on a canvas. */
export interface CanvasFrame {
  readonly camera: Camera;
  readonly surface: Surface;
  /** Premultiplied. */
  readonly background?: Rgba | undefined;
  /** What is other than at rest. */
  readonly settings?: Partial<PerFrameSettings> | undefined;
  /** The picture is read in the same task. */
  readonly isRead?: boolean;
}

/** Draws frames on canvases: a `Viewport` with WebGPU, a `GlPainter` with WebGL. */
export interface Painter {
  readonly place: Place;
  /** @throws GaussianSplatError `unsupported/webgl` without WebGPU. */
  readonly device: GPUDevice;
  /** Bytes of GPU memory that frames are drawn with, the splats not counted. */
  readonly byteLength: number;
  /** Share of the pixels of each side that frames are drawn with because splats cover them too often, 0..1. */
  readonly pixelShare: number;
  readonly isDestroyed: boolean;
  readonly isLost: boolean;
  /** True if there is what frames with other settings need. */
  readonly isPrepared: boolean;
  /** What stands between the renderer and the canvas; undefined for frames as they are drawn. */
  readonly filter: FrameFilter | undefined;
  /** It closes its filter when it gets another one, and when it is destroyed. */
  setFilter(filter: FrameFilter | undefined): void;
  /** Draws the frames to come like this. */
  setRendering(rendering: Rendering): void;
  /** Makes what frames with other settings need, so that none of them has to. */
  prepare(settings: readonly Partial<PerFrameSettings>[]): void;
  /** The canvas's context, set up to be drawn into; null for a canvas of another kind. */
  surfaceOn(canvas: HTMLCanvasElement): Surface | null;
  /**
   * Encodes and submits one frame.
   * @param content what `Contents.prepareFrame` has just returned
   * @param onTime gets how long the frame kept the GPU, some frames later
   */
  render(frame: CanvasFrame, content: string, onTime?: (time: WorkTime) => void): void;
  /**
   * Renders the first frame, and waits until the GPU has finished it.
   * @throws GaussianSplatError `out-of-memory/allocation`
   */
  renderFirst(frame: CanvasFrame, content: string): Promise<void>;
  /** Looks into the last frame: see `Viewpoint.probe`. */
  probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]>;
  /** Counts of the last frame, and of a view. Reads back from the GPU: for panels, not for frames. */
  readCounts(camera: Camera): Promise<ReadCounts>;
  /** Fulfils when the GPU has done all that was asked of it, or is lost. */
  finished(): Promise<unknown>;
  /** Frees the GPU memory. What it draws is its owner's. */
  destroy(): void;
}
