import type { SplatFilter } from '@gaussian-splat/core';
import type { Frame } from './frame.js';
import type { PageRequests } from './gaussian-scene.js';
import type { FrameTimer } from './gpu/pass-timer.js';
import type { RenderSettings, Quality } from './render-settings.js';
import { renderSettingsOf } from './render-settings.js';
import type { Resource } from './gpu/kernel.js';
import type { AuxiliaryOutputs, PaintingDepth, Surface } from './rasterizers/rasterizer.js';

/** Red, green, blue and alpha, 0..1; colors are premultiplied by alpha. */
export type Rgba = readonly [red: number, green: number, blue: number, alpha: number];

/** A texture view, and its format, which cannot be queried. */
export interface TargetView {
  readonly view: GPUTextureView;
  /** Any color format that WebGPU can render to. */
  readonly format: GPUTextureFormat;
}

/** A validated target of a frame. */
export interface Target extends Surface {
  /** Texture of the target; undefined for a target that is a view. */
  readonly texture?: GPUTexture | undefined;
  /** Whether a compute shader may write to the texture. */
  readonly isStorable: boolean;
}

/**
 * Composes accumulated splats over the background instead of the viewpoint's default, for example {@link LinearColors}.
 */
export interface Compositor {
  /**
   * Records a render pass that composes `accumulated` into the target. `keeps` is true if the content of the target is
   * the background.
   */
  compose(
    encoder: GPUCommandEncoder,
    resources: Readonly<Record<'compose' | 'accumulated', Resource>>,
    target: Target,
    keeps: boolean,
  ): void;
}

/** Target of a frame, and what is combined with its splats. */
export interface FrameTarget {
  /**
   * Texture or view of the size of the camera's image. Its first level and layer are drawn. A texture with the usage
   * STORAGE_BINDING saves the rasterizer `tiles` a pass.
   */
  readonly target: GPUTexture | TargetView;
  /**
   * Background of the splats: a color, or `load` for the content of the target, as in WebGPU's `loadOp`. Default:
   * transparent.
   */
  readonly background?: Rgba | 'load' | undefined;
  /**
   * Color conversion: a {@link LinearColors} for targets of linear light. Default: sRGB-encoded colors, as in training.
   */
  readonly colors?: Compositor | undefined;
  /** Depth of the meshes in the frame, and the texture that receives the depth of the splats: a {@link SceneDepth}. */
  readonly depth?: PaintingDepth | undefined;
  /**
   * Low-pass filter of all scenes of the frame. Default: the filter that each scene was trained with, if its file
   * states it.
   */
  readonly filter?: SplatFilter | undefined;
  /** Auxiliary outputs besides the image. They require the rasterizer `tiles`, and are too slow for every frame. */
  readonly auxiliary?: AuxiliaryOutputs | undefined;
  /**
   * Replaces the stages before the rasterizer. {@link Stereo} runs some of them once for several views. Returns the
   * page requests of streamed scenes.
   */
  readonly project?: ((encoder: GPUCommandEncoder, frame: Frame) => PageRequests[]) | undefined;
  /** Timer that records the duration of each pass. */
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
