import type { HostedGaussians, SceneHost } from '@gaussian-splat/core';
import type { GaussianLayout } from '@gaussian-splat/core/contract';
import type { Object3D } from 'three/webgpu';
import { DynamicGaussians } from '@gaussian-splat/renderer';
import { SplatScene, type SplatSceneOptions } from './splat-scene.js';

/**
 * The output of a generator, as an object of a three.js scene:
 *
 * ```ts
 * const models = new GaussianModels();
 * models.registerGaussianGenerator('avatar', { url: 'avatar.onnx' });
 * await models.loadAllGenerators(device); // renderer.backend.device
 * const { gaussians: avatar } = await models.addGaussianModelToScene('avatar', scene); // after new SplatRenderer(renderer)
 * avatar.position.x = 2;
 * models.runGenerators({ timeSeconds: 1 });
 * ```
 */
export class GeneratedSplats extends SplatScene {
  readonly #written: DynamicGaussians;

  /** Creates the object for the Gaussians of a generator. Call {@link create} instead, which also allocates them. */
  constructor(written: DynamicGaussians, options?: SplatSceneOptions) {
    super(written, options);
    this.type = 'GeneratedSplats';
    this.#written = written;
  }

  /**
   * Allocates the Gaussians of a generator, and creates the object that draws them.
   * @param layout Layout of the generator's model.
   * @throws the errors of `DynamicGaussians.create`
   */
  static async create(
    device: GPUDevice,
    layout: GaussianLayout,
    options?: SplatSceneOptions,
  ): Promise<GeneratedSplats> {
    return new GeneratedSplats(await DynamicGaussians.create(device, layout), options);
  }

  /** Receives the output of a run: see `DynamicGaussians.ingest`. */
  ingest(...run: Parameters<DynamicGaussians['ingest']>): void {
    this.#written.ingest(...run);
  }

  /** Number of runs that were received, plus one. Draw a frame after each change. */
  get version(): number {
    return this.#written.version;
  }

  /** Removes the object from the scene graph and frees its GPU memory. Remove the model first. */
  dispose(): void {
    this.removeFromParent();
    this.#written.destroy();
  }
}

/** Host that adds models of `@gaussian-splat/generator` to scenes of three.js. */
export const generatedSplatsHost: SceneHost<Object3D, GPUDevice, GeneratedSplats> = {
  accepts: (scene: unknown): scene is Object3D => (scene as Partial<Object3D> | null)?.isObject3D === true,
  async receive(scene, device, layout): Promise<HostedGaussians<GeneratedSplats>> {
    const gaussians = await GeneratedSplats.create(device, layout);
    scene.add(gaussians);
    return { gaussians, remove: () => gaussians.dispose() };
  },
};
