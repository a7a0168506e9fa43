import type { FrameTimer } from './gpu/pass-timer.js';
import type { Levers, Quality } from './levers.js';
import { leversOf } from './levers.js';
import type { FrameNotes, PaintingDepth } from './rasterizers/rasterizer.js';

/** Red, green, blue and alpha, colour premultiplied. */
export type Rgba = readonly [red: number, green: number, blue: number, alpha: number];

/** A view of a texture, with what cannot be asked of it. */
export interface TargetView {
  readonly view: GPUTextureView;
  /** Any colour format that WebGPU can render to. */
  readonly format: GPUTextureFormat;
}

/** What a frame is drawn into. */
export interface Picture {
  /**
   * As large as the camera's image. A texture with the usage STORAGE_BINDING saves `tiles` a pass; of one with several levels or layers the first is
   * drawn into.
   */
  readonly target: GPUTexture | TargetView;
  /** What is behind the splats: a colour, or what the target holds already. Default: transparent. */
  readonly over?: Rgba | 'target' | undefined;
  /** Depth of what else is in the picture, and where to write that of the splats: a {@link SceneDepth}. */
  readonly depth?: PaintingDepth | undefined;
  /** What to note besides the image: `tiles` only, and not for every frame: all splats are put in order for it. */
  readonly notes?: FrameNotes | undefined;
  /** Notes when each pass ran. */
  readonly timer?: FrameTimer | undefined;
}

/**
 * How a frame is drawn: a quality, and single levers that differ from it. Give the same object for the same settings: what they take is remembered by the
 * object. See {@link settings}.
 */
export interface FrameSettings extends Partial<Levers> {
  /** Default: `default`. */
  readonly quality?: Quality;
}

/**
 * Settings for frames, checked.
 *
 * ```ts
 * const moving = settings('balanced', { resolutionScale: 0.7 });
 * viewpoint.draw(camera, picture, moving);
 * ```
 * @throws GaussianSplatError `argument/value` for an unknown quality or a value out of its lever's range.
 */
export const settings = (quality: Quality = 'default', changes: Partial<Levers> = {}): FrameSettings =>
  Object.freeze(leversOf({ ...changes, quality }));
