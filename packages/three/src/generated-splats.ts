import type { GaussianLayout } from '@gaussian-splat/core/contract';
import { DynamicGaussians } from '@gaussian-splat/renderer';
import { SplatScene, type SplatSceneOptions } from './splat-scene.js';

/**
 * What a generator writes, as an object of a three.js scene. Make it where `@gaussian-splat/generator` asks for a sink:
 *
 * ```ts
 * const models = new GaussianModels();
 * models.registerGaussianGenerator('avatar', { url: 'avatar.onnx' });
 * await models.loadAllGenerators(device); // renderer.backend.device
 * const { gaussians: avatar } = await models.addGaussianModelToScene('avatar', (layout) => GeneratedSplats.create(device, layout));
 * avatar.position.x = 2;
 * scene.add(avatar);
 * models.runGenerators({ timeSeconds: 1 });
 * ```
 */
export class GeneratedSplats extends SplatScene {
  readonly #written: DynamicGaussians;

  /** Made by {@link create}. */
  constructor(written: DynamicGaussians, options?: SplatSceneOptions) {
    super(written, options);
    this.type = 'GeneratedSplats';
    this.#written = written;
  }

  /** @throws GaussianSplatError as `DynamicGaussians.create` does. */
  static async create(
    device: GPUDevice,
    layout: GaussianLayout,
    options?: SplatSceneOptions,
  ): Promise<GeneratedSplats> {
    return new GeneratedSplats(await DynamicGaussians.create(device, layout), options);
  }

  /** Takes a run of the generator in: see `DynamicGaussians.ingest`. */
  ingest(...run: Parameters<DynamicGaussians['ingest']>): void {
    this.#written.ingest(...run);
  }

  /** Number of runs taken in until now, and one: a frame is due when it has grown. */
  get version(): number {
    return this.#written.version;
  }

  /** Takes it out of the scene graph and frees its GPU memory. Remove the model first. */
  dispose(): void {
    this.removeFromParent();
    this.#written.destroy();
  }
}
