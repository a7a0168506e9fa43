/** Loaded only where a page asks for economy. */
import { LiveMask, parseEconomyGoal, type EconomyGoal } from '@gaussian-splat/economise';
import { GaussianBuffers } from '@gaussian-splat/renderer';
import type { EconomyReport } from '../controllers/economy-controller.js';
import type { GpuScene } from '../gpu/gpu-scene.js';

/** What the element's core knows of this module. */
export type Economy = SceneEconomy;

export const goalOf = parseEconomyGoal;

/** A scene on show, and all of its splats in the page's memory: those that are left out take none on the GPU. */
export class SceneEconomy {
  readonly #scene: GpuScene;
  readonly #mask: LiveMask;

  private constructor(scene: GpuScene, mask: LiveMask) {
    this.#scene = scene;
    this.#mask = mask;
  }

  /** Scores a scene that is on show. Takes seconds for large ones, beside the frames. */
  static async of(scene: GpuScene): Promise<SceneEconomy> {
    const abort = new AbortController();
    // A scene that is taken away meanwhile has no buffers any more.
    scene.onDestroy = () => abort.abort();
    return new SceneEconomy(
      scene,
      await LiveMask.of(scene.device, scene.gaussians, scene.bounds, { signal: abort.signal }),
    );
  }

  /** Shows what the goal leaves of the scene, null for all of it. Rejects with the signal's reason, or GaussianSplatError `out-of-memory/*`. */
  async apply(goal: EconomyGoal | null, memoryBudget: number | undefined, signal: AbortSignal): Promise<EconomyReport> {
    const { whole } = this.#mask;
    const { packed, decibels } =
      goal === null ? { packed: whole, decibels: null } : await this.#mask.masked(goal, signal);
    const gaussians = await GaussianBuffers.upload(this.#scene.device, packed, { memoryBudget });
    if (signal.aborted || this.#scene.isDestroyed) {
      gaussians.destroy();
      signal.throwIfAborted();
    } else {
      this.#scene.replaceGaussians(gaussians);
    }
    return { spared: whole.count - packed.count, decibels };
  }
}
