/** A viewpoint whose scenes are named with each frame, for tests that draw one scene after another. */
import type { Camera } from '@gaussian-splat/core';
import * as product from '@gaussian-splat/renderer';
import {
  World,
  type CaptureRequest,
  type FrameSettings,
  type FrameTarget,
  type GaussianScene,
} from '@gaussian-splat/renderer';

/** Settings, and who is called when a frame lacked room. */
export interface RendererOptions extends FrameSettings {
  readonly onIncomplete?: () => void;
}

/** One image to draw. */
export interface FrameRequest extends Omit<FrameTarget, 'target' | 'background'> {
  /** One scene, or several that are sorted and blended together. */
  readonly gaussians: GaussianScene | readonly GaussianScene[];
  readonly camera: Camera;
  readonly target: GPUTexture | GPUTextureView;
  /** Format of a target that is a view. */
  readonly targetFormat?: GPUTextureFormat;
  readonly background?: FrameTarget['background'];
  readonly detail?: number;
  readonly splatBudget?: number;
  /** Settings of this frame that differ from the renderer's. */
  readonly settings?: FrameSettings;
}

export class Renderer extends product.Viewpoint {
  readonly #options: FrameSettings;

  constructor(device: GPUDevice, { onIncomplete, ...options }: RendererOptions = {}) {
    super(device, new World(), { settings: options, onIncomplete });
    this.#options = options;
  }

  render({
    gaussians,
    camera,
    target,
    targetFormat,
    background,
    detail,
    splatBudget,
    settings,
    ...rest
  }: FrameRequest): void {
    this.show(gaussians);
    const isView = targetFormat !== undefined && !('createView' in target);
    const into = isView ? { view: target, format: targetFormat } : (target as GPUTexture);
    this.draw(
      camera,
      { ...rest, target: into, background: background },
      this.settingsOf({ detail, splatBudget, settings }),
    );
  }

  /** Settings of a frame that names some of its own; undefined for one that names none. */
  settingsOf({
    detail,
    splatBudget,
    settings,
  }: Pick<FrameRequest, 'detail' | 'splatBudget' | 'settings'>): FrameSettings | undefined {
    if (!settings && detail === undefined && splatBudget === undefined) return settings;
    return {
      ...this.#options,
      ...settings,
      ...(detail !== undefined && { detail }),
      ...(splatBudget !== undefined && { splatBudget }),
    };
  }

  /** Makes these the scenes of the world; those that are in it already stay. */
  show(gaussians: FrameRequest['gaussians']): void {
    const { world } = this;
    const left = new Set(world.placements);
    const come = [gaussians].flat().filter((scene) => {
      const known = [...left].find((placement) => placement.scene === scene);
      return known === undefined || !left.delete(known);
    });
    for (const placement of left) world.remove(placement);
    for (const scene of come) world.add({ scene });
  }
}

/** As the renderer's `capture`, of a viewpoint or of the scenes that the request names. */
export function capture(
  device: GPUDevice,
  viewpoint: product.Viewpoint,
  request: CaptureRequest | Omit<FrameRequest, 'target' | 'targetFormat'>,
): Promise<Float32Array> {
  if (!('gaussians' in request)) return product.capture(device, viewpoint, request);
  const { gaussians, background, detail, splatBudget, settings, ...rest } = request;
  const renderer = viewpoint as Renderer;
  renderer.show(gaussians);
  return product.capture(device, renderer, {
    ...rest,
    background: background,
    settings: renderer.settingsOf({ detail, splatBudget, settings }),
  });
}
