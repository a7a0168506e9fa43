/** What a viewpoint checks of the arguments of its callers. The element's bundles, whose arguments are all its own, have `unchecked.ts` in its place. */
import type { Camera } from '@gaussian-splat/core';
import type { FrameSettings, FrameTarget } from './frame-target.js';
import type { RenderSettings } from './render-settings.js';
import { requireAuxiliary, requireFrameTarget, requireTarget, requireTextureSize } from './requirements.js';

export { renderSettingsOf as settingsOf } from './render-settings.js';

/** @throws GaussianSplatError for what no frame can be drawn with, before settings are read. */
export function checkArguments(device: GPUDevice, camera: Camera, picture: FrameTarget, settings: FrameSettings): void {
  requireTextureSize(device, camera);
  requireFrameTarget(picture, settings);
}

/** @throws GaussianSplatError for a frame that cannot be drawn. */
export function checkFrame(camera: Camera, { target, auxiliary }: FrameTarget, settings: RenderSettings): void {
  requireTarget('createView' in target ? target : undefined, target.format, camera);
  if (auxiliary) requireAuxiliary(settings);
}
