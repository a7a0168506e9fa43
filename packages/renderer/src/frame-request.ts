import type { Camera, SplatFilter } from '@gaussian-splat/core';
import type { GaussianScene } from './gaussian-scene.js';
import type { FrameTimer } from './gpu/pass-timer.js';
import type { FrameLevers, Levers, Quality } from './levers.js';
import type { FrameNotes } from './rasterizers/rasterizer.js';

/** A quality, and single levers that differ from it. */
export interface RendererOptions extends Partial<Levers> {
  /** Default: `default`. */
  readonly quality?: Quality;
  /**
   * Called when a frame that was drawn lacked splats for want of room in the renderer's buffers. The next frame has the room: draw it.
   */
  readonly onIncomplete?: () => void;
}

/** One image to draw. */
export interface FrameRequest {
  /** One scene, or several that are sorted and blended together. Order decides between equal depths. */
  readonly gaussians: GaussianScene | readonly GaussianScene[];
  /** Its width and height must be those of the target. */
  readonly camera: Camera;
  /** A texture with the usage STORAGE_BINDING saves `tiles` a pass. Of one with several levels or layers the first is drawn into. */
  readonly target: GPUTexture | GPUTextureView;
  /** Format of a target that is a view: any colour format that WebGPU can render to. */
  readonly targetFormat?: GPUTextureFormat;
  /** Premultiplied red, green, blue and alpha behind the splats. Default: transparent. */
  readonly background?: readonly [red: number, green: number, blue: number, alpha: number];
  /** Low-pass filter of all scenes of the frame. Default: the one that each was trained with, as far as its file tells. */
  readonly filter?: SplatFilter | undefined;
  /** The levers of these names, for this frame alone. */
  readonly detail?: number;
  readonly splatBudget?: number;
  /**
   * What to note besides the image: `tiles` only, and not for every frame.
   */
  readonly notes?: FrameNotes;
  /**
   * Levers of this frame alone, for pictures in motion. Give the same object for the same levers, and {@link Renderer.prepare} it: what it
   * takes is remembered by the object.
   */
  readonly levers?: Partial<FrameLevers>;
  /** Notes when each pass ran. */
  readonly timer?: FrameTimer;
}
