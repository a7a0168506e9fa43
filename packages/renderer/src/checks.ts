/**
 * Argument checks of a viewpoint. The bundles of the element, which pass only their own arguments, use `unchecked.ts`
 * instead.
 */
import type { Camera } from '@gaussian-splat/core';
import type { FrameSettings, FrameTarget } from './frame-target.js';
import type { RenderSettings } from './render-settings.js';
import { requireAuxiliary, requireFrameTarget, requireTarget } from './requirements.js';
import { requireTextureSize } from './texture-size.js';

export { renderSettingsOf as settingsOf } from './render-settings.js';

/**
 * Checks the arguments of a frame before its settings are read.
 * @throws GaussianSplatError `argument/value` for a target, camera size or settings with which no frame can be drawn.
 */
export function checkArguments(
  device: GPUDevice,
  camera: Camera,
  frameTarget: FrameTarget,
  settings: FrameSettings,
): void {
  requireTextureSize(device, camera);
  requireFrameTarget(frameTarget, settings);
}

/**
 * Checks a frame with its resolved settings.
 * @throws GaussianSplatError `argument/value` for a target or auxiliary outputs that cannot be drawn.
 */
export function checkFrame(camera: Camera, { target, auxiliary }: FrameTarget, settings: RenderSettings): void {
  requireTarget('createView' in target ? target : undefined, target.format, camera);
  if (auxiliary) requireAuxiliary(settings);
}
