import type { Box, GaussianScene } from '@gaussian-splat/renderer';
import { Object3D } from 'three/webgpu';

export interface SplatSceneOptions {
  /** Factor of the opacity of each splat, 0..1. Default: 1. */
  readonly opacity?: number;
  /** Box in the scene's own coordinates. Only splats whose centers are inside are drawn. Default: all. */
  readonly crop?: Box;
}

/**
 * Gaussian splats as an object of a three.js scene: its matrix places them, `visible` and `layers` hide them. A {@link SplatRenderer} draws them.
 *
 * ```ts
 * const splats = new SplatScene(await GaussianBuffers.upload(renderer.backend.device, packGaussians(cloud)));
 * splats.rotation.x = Math.PI; // captures have y down
 * scene.add(splats);
 * ```
 */
export class SplatScene extends Object3D {
  readonly isSplatScene = true;
  /** The drawn Gaussians. Their creator frees them. */
  gaussians: GaussianScene;
  opacity: number;
  crop: Box | undefined;

  constructor(gaussians: GaussianScene, { opacity = 1, crop }: SplatSceneOptions = {}) {
    super();
    this.type = 'SplatScene';
    this.gaussians = gaussians;
    this.opacity = opacity;
    this.crop = crop;
  }
}

/** Whether an object is a {@link SplatScene}, from any copy of this package. */
export const isSplatScene = (object: object): object is SplatScene => 'isSplatScene' in object;
