import type { SplatFilter } from '@gaussian-splat/core';
import type { FrameTimer } from './gpu/pass-timer.js';
import type { RenderSettings, Quality } from './render-settings.js';
import { renderSettingsOf } from './render-settings.js';
import type { Resource } from './gpu/kernel.js';
import type { AuxiliaryOutputs, PaintingDepth, Surface } from './rasterizers/rasterizer.js';

/** Red, green, blue and alpha; color premultiplied. */
export type Rgba = readonly [red: number, green: number, blue: number, alpha: number];

/** A texture view, with the properties that cannot be queried. */
export interface TargetView {
  readonly view: GPUTextureView;
  /** Any color format that WebGPU can render to. */
  readonly format: GPUTextureFormat;
}

/** A validated target. */
export interface Target extends Surface {
  /** The texture, if it is known. */
  readonly texture?: GPUTexture | undefined;
  /** Whether a compute shader may write it. */
  readonly isStorable: boolean;
}

/** Composes accumulated splats over the background, instead of the viewpoint's default: see {@link LinearColors}. */
export interface Compositor {
  compose(
    encoder: GPUCommandEncoder,
    resources: Readonly<Record<'compose' | 'accumulated', Resource>>,
    target: Target,
    keeps: boolean,
  ): void;
}

/** Target of a frame. */
export interface FrameTarget {
  /**
   * A texture or view of the size of the camera's image. A texture with the usage STORAGE_BINDING saves `tiles` a pass;
   * of several levels or layers the first is the target.
   */
  readonly target: GPUTexture | TargetView;
  /** Background of the splats: a color, or the content of the target. Default: transparent. */
  readonly over?: Rgba | 'target' | undefined;
  /**
   * Color conversion: a {@link LinearColors} for targets of linear light. Default: sRGB-encoded, as scenes are trained.
   */
  readonly colors?: Compositor | undefined;
  /** Depth of the meshes in the frame, and the destination of the splats' depth: a {@link SceneDepth}. */
  readonly depth?: PaintingDepth | undefined;
  /** Low-pass filter of all scenes of the frame. Default: that of the training of each scene, if its file states it. */
  readonly filter?: SplatFilter | undefined;
  /** Auxiliary outputs besides the image: `tiles` only, and not for every frame. */
  readonly auxiliary?: AuxiliaryOutputs | undefined;
  /** Records when each pass ran. */
  readonly timer?: FrameTimer | undefined;
}

/**
 * Settings of a frame: a quality, and single settings that override it. Reuse one object for the same settings, because
 * derived values are cached by object. See {@link settings}.
 */
export interface FrameSettings extends Partial<RenderSettings> {
  /** Default: `default`. */
  readonly quality?: Quality;
}

/**
 * Returns validated settings for frames.
 *
 * ```ts
 * const moving = settings('balanced', { resolutionScale: 0.7 });
 * viewpoint.draw(camera, { target: texture }, moving);
 * ```
 * @throws GaussianSplatError `argument/value` for an unknown quality or a value out of its range.
 */
export const settings = (quality: Quality = 'default', changes: Partial<RenderSettings> = {}): FrameSettings =>
  Object.freeze(renderSettingsOf({ ...changes, quality }));
