/**
 * Argument checks of a viewpoint. The bundles of the element, which pass only their own arguments, use `unchecked.ts`
 * instead.
 */
import type { Camera } from '@gaussian-splat/core';
import type { FrameSettings, FrameTarget } from './frame-target.js';
import type { RenderSettings } from './render-settings.js';
import { requireAuxiliary, requireFrameTarget, requireTarget, requireTextureSize } from './requirements.js';

export { renderSettingsOf as settingsOf } from './render-settings.js';

/** @throws GaussianSplatError for arguments with which no frame can be drawn, before settings are read. */
export function checkArguments(
  device: GPUDevice,
  camera: Camera,
  frameTarget: FrameTarget,
  settings: FrameSettings,
): void {
  requireTextureSize(device, camera);
  requireFrameTarget(frameTarget, settings);
}

/** @throws GaussianSplatError for a frame that cannot be drawn. */
export function checkFrame(camera: Camera, { target, auxiliary }: FrameTarget, settings: RenderSettings): void {
  requireTarget('createView' in target ? target : undefined, target.format, camera);
  if (auxiliary) requireAuxiliary(settings);
}
