/** What a viewpoint checks of the arguments of its callers. The element's bundles, whose arguments are all its own, have `unchecked.ts` in its place. */
import type { Camera } from '@gaussian-splat/core';
import type { FrameTarget } from './frame-target.js';
import type { RenderSettings } from './render-settings.js';
import { requireAuxiliary, requireTarget } from './requirements.js';

export { renderSettingsOf as settingsOf } from './render-settings.js';
export { requireFrameTarget as checkArguments } from './requirements.js';

/** @throws GaussianSplatError for a frame that cannot be drawn. */
export function checkFrame(camera: Camera, { target, auxiliary }: FrameTarget, settings: RenderSettings): void {
  requireTarget('createView' in target ? target : undefined, target.format, camera);
  if (auxiliary) requireAuxiliary(settings);
}
