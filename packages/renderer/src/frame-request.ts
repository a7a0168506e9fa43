import type { Camera } from '@gaussian-splat/core';
import type { GaussianScene } from './gaussian-scene.js';
import type { PerFrameSettings } from './render-settings.js';
import type { FrameSettings, FrameTarget, Rgba } from './frame-target.js';

/** Settings, and who is called when a frame lacked room: see {@link ViewpointOptions}. */
export interface RendererOptions extends FrameSettings {
  readonly onIncomplete?: () => void;
}

/** One image to draw. */
export interface FrameRequest extends Pick<FrameTarget, 'filter' | 'auxiliary' | 'timer'> {
  /** One scene, or several that are sorted and blended together. Of equal depths the scene that came first is in front. */
  readonly gaussians: GaussianScene | readonly GaussianScene[];
  /** Its width and height must be those of the target. */
  readonly camera: Camera;
  /** See {@link FrameTarget.target}. */
  readonly target: GPUTexture | GPUTextureView;
  /** Format of a target that is a view. */
  readonly targetFormat?: GPUTextureFormat;
  /** See {@link FrameTarget.over}. */
  readonly background?: Rgba;
  /** The settings of these names, for this frame alone. */
  readonly detail?: number;
  readonly splatBudget?: number;
  /** Settings of this frame alone, for frames in motion. */
  readonly settings?: Partial<PerFrameSettings>;
}
