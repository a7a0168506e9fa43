import type { Camera } from '@gaussian-splat/core';
import type { FrameRequest, RendererOptions } from './frame-request.js';
import type { GaussianScene } from './gaussian-scene.js';
import { requireScenes } from './requirements.js';
import { Viewpoint } from './checked-viewpoint.js';
import { World, type Placement } from './world.js';

/** A {@link Viewpoint} whose world is named with each frame: for those who draw one scene after another. */
export class Renderer extends Viewpoint {
  readonly #options: RendererOptions;

  /** @throws GaussianSplatError as the constructor of {@link Viewpoint} does. */
  constructor(device: GPUDevice, { onIncomplete, ...options }: RendererOptions = {}) {
    super(device, new World(), { settings: options, onIncomplete });
    this.#options = options;
  }

  /**
   * Encodes and submits one frame.
   * @throws GaussianSplatError as {@link Viewpoint.draw} does.
   */
  render(request: FrameRequest): void {
    const { gaussians, camera, target, targetFormat, background, filter, auxiliary, timer } = request;
    const { settings: changes, detail, splatBudget } = request;
    requireScenes(gaussians, changes);
    this.#show(Array.isArray(gaussians) ? gaussians : [gaussians as GaussianScene]);
    const own = changes ?? detail ?? splatBudget;
    const settings =
      own === undefined ? undefined : { ...this.#options, ...changes, ...given({ detail, splatBudget }) };
    const view = targetFormat === undefined || isTexture(target) ? target : { view: target, format: targetFormat };
    this.draw(camera as Camera, { target: view as GPUTexture, over: background, filter, auxiliary, timer }, settings);
  }

  #show(scenes: readonly GaussianScene[]): void {
    const left = new Set<Placement>(this.world.placements);
    const come = scenes.filter((scene) => {
      const known = [...left].find((placement) => placement.scene === scene);
      return known === undefined || !left.delete(known);
    });
    for (const placement of left) this.world.remove(placement);
    for (const scene of come) this.world.add({ scene });
  }
}

const isTexture = (target: GPUTexture | GPUTextureView): target is GPUTexture => 'createView' in target;

/** Those of the values that are given. */
const given = <T extends object>(values: T): Partial<T> =>
  Object.fromEntries(Object.entries(values).filter(([, value]) => value !== undefined)) as Partial<T>;
