import type { Camera } from '@gaussian-splat/core';
import { renderSettingsOf, type RenderSettings } from './render-settings.js';
import type { FrameSettings, FrameTarget } from './frame-target.js';
import { requireAuxiliary, requireFrameTarget, requireTarget } from './requirements.js';
import { UncheckedViewpoint } from './viewpoint.js';

/** One of several views: see {@link Viewpoint.drawAll}. */
export interface View {
  readonly camera: Camera;
  readonly picture: FrameTarget;
}

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
  /**
   * Records one frame into a host's encoder, between its passes, and submits nothing. The host submits within the same task: what the viewpoint learns of a frame
   * (how much room it needs, which pages it asks for) it reads in the next one. Record a viewpoint once for each submission: its uniforms are those of
   * the last frame that was recorded. `submissions` of the settings, and `timer` of the frame, are the host's.
   * @throws GaussianSplatError as {@link draw} does.
   */
  record(
    encoder: GPUCommandEncoder,
    camera: Camera,
    picture: FrameTarget,
    settings: FrameSettings = this.settings,
  ): void {
    const hosted = { ...picture, timer: undefined };
    const encoded = this.encode(encoder, camera, hosted, settings, false);
    if (encoded.isWatched || encoded.wishes.length > 0) setTimeout(() => this.readLater(encoded));
  }

  /**
   * Draws several views of the world, such as both eyes or thumbnails: sizes that come again keep their buffers.
   * @throws GaussianSplatError as {@link draw} does.
   */
  drawAll(views: readonly View[], settings: FrameSettings = this.settings): void {
    const sizes = new Set(views.map(({ camera: { width, height } }) => `${width} ${height}`));
    this.mostSizes = Math.max(1, sizes.size);
    for (const { camera, picture } of views) this.draw(camera, picture, settings);
  }

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
