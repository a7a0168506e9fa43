import type { SplatFilter } from '@gaussian-splat/core';
import type { FrameTimer } from './gpu/pass-timer.js';
import type { RenderSettings, Quality } from './render-settings.js';
import { renderSettingsOf } from './render-settings.js';
import type { Resource } from './gpu/kernel.js';
import type { AuxiliaryOutputs, PaintingDepth, Surface } from './rasterizers/rasterizer.js';

/** Red, green, blue and alpha, colour premultiplied. */
export type Rgba = readonly [red: number, green: number, blue: number, alpha: number];

/** A view of a texture, with what cannot be asked of it. */
export interface TargetView {
  readonly view: GPUTextureView;
  /** Any colour format that WebGPU can render to. */
  readonly format: GPUTextureFormat;
}

/** A target that has been checked. */
export interface Target extends Surface {
  /** Where more is known of it than a view. */
  readonly texture?: GPUTexture | undefined;
  /** Whether a compute shader may write it. */
  readonly isStorable: boolean;
}

/** Lays accumulated splats over what is behind them, in place of the viewpoint's own way: see {@link LinearColours}. */
export interface Composer {
  compose(
    encoder: GPUCommandEncoder,
    resources: Readonly<Record<'compose' | 'accumulated', Resource>>,
    target: Target,
    keeps: boolean,
  ): void;
}

/** What a frame is drawn into. */
export interface FrameTarget {
  /**
   * As large as the camera's image. A texture with the usage STORAGE_BINDING saves `tiles` a pass; of one with several levels or layers the first is
   * drawn into.
   */
  readonly target: GPUTexture | TargetView;
  /** What is behind the splats: a colour, or what the target holds already. Default: transparent. */
  readonly over?: Rgba | 'target' | undefined;
  /** How colours are written: a {@link LinearColours} for targets of linear light. Default: encoded as sRGB, as scenes are trained. */
  readonly colours?: Composer | undefined;
  /** Depth of what else is in the frame, and where to write that of the splats: a {@link SceneDepth}. */
  readonly depth?: PaintingDepth | undefined;
  /** Low-pass filter of all scenes of the frame. Default: the one that each was trained with, as far as its file tells. */
  readonly filter?: SplatFilter | undefined;
  /** What to note besides the image: `tiles` only, and not for every frame. */
  readonly auxiliary?: AuxiliaryOutputs | undefined;
  /** Notes when each pass ran. */
  readonly timer?: FrameTimer | undefined;
}

/**
 * How a frame is drawn: a quality, and single settings that differ from it. Give the same object for the same settings: what they take is remembered by the
 * object. See {@link settings}.
 */
export interface FrameSettings extends Partial<RenderSettings> {
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
 * @throws GaussianSplatError `argument/value` for an unknown quality or a value out of its range.
 */
export const settings = (quality: Quality = 'default', changes: Partial<RenderSettings> = {}): FrameSettings =>
  Object.freeze(renderSettingsOf({ ...changes, quality }));
