import type { Camera } from '@gaussian-splat/core';
import { renderSettingsOf, type RenderSettings } from './render-settings.js';
import type { FrameSettings, FrameTarget } from './frame-target.js';
import { requireAuxiliary, requireFrameTarget, requireTarget } from './requirements.js';
import { UncheckedViewpoint } from './viewpoint.js';

/**
 * Draws a world, on your own device.
 *
 * ```ts
 * const world = new World();
 * world.add({ scene: await GaussianBuffers.upload(device, packGaussians(cloud)) });
 * const viewpoint = new Viewpoint(device, world);
 * viewpoint.draw(camera, { target: texture });
 * ```
 *
 * Memory is allocated when scenes come, and when the image size or the share of visible splats changes, never while only the camera or a scene moves; no frame
 * waits for a read-back. Each frame sorts the splats that it shows.
 */
export class Viewpoint extends UncheckedViewpoint {
  protected override check(camera: Camera, picture: FrameTarget, settings: FrameSettings): void {
    requireFrameTarget(picture, settings);
    const { target, auxiliary } = picture;
    requireTarget('createView' in target ? target : undefined, target.format, camera);
    if (auxiliary) requireAuxiliary(this.resolve(settings));
  }

  protected override complete(settings: FrameSettings): RenderSettings {
    return renderSettingsOf(settings);
  }
}
