import type { GpuScene } from '../gpu/gpu-scene.js';
import type { Economy } from '../economy/scene-economy.js';

export interface EconomyOptions {
  /** The attribute. */
  readonly economy: () => string | null;
  readonly memoryBudget: () => number | undefined;
  /** Another part of the scene is on show. */
  readonly onChange: () => void;
  readonly warn: (sentence: string) => void;
}

/** What is left out of a scene, for people and panels. */
export interface EconomyReport {
  /** Splats of the scene that are left out. */
  readonly spared: number;
  /** dB to the whole scene, where a figure was asked for. */
  readonly decibels: number | null;
  /** Whether it is known what shows from where. */
  readonly byView: boolean;
}

const NOTHING: EconomyReport = { spared: 0, decibels: null, byView: false };

/** Leaves out of a scene what no view needs, as far as the page asks for it, after the whole scene is on show; and puts it back. */
export class EconomyController {
  readonly #options: EconomyOptions;
  #scene: GpuScene | null = null;
  #wish: string | null = null;
  #running = new AbortController();
  #economy: Economy | undefined;

  constructor(options: EconomyOptions) {
    this.#options = options;
  }

  get report(): EconomyReport {
    return this.#economy?.report ?? NOTHING;
  }

  /** Looks at the scene that is on show whole, or null for none, and at the attribute. Safe to call as often as one likes. */
  update(scene: GpuScene | null): void {
    const wish = this.#options.economy();
    if (scene === this.#scene && wish === this.#wish) return;
    if (scene !== this.#scene) this.#forget();
    this.#scene = scene;
    this.#wish = wish;
    this.#running.abort();
    this.#running = new AbortController();
    // Nor of levels of detail that are the file's own, which stand for one another.
    if (scene === null || scene.live !== undefined || scene.hasOwnLevels) return;
    // Whoever never asks for it never loads it.
    if (wish === null && this.#economy === undefined) return;
    void this.#apply(scene, wish, this.#running.signal);
  }

  #forget(): void {
    this.#running.abort();
    this.#economy = undefined;
  }

  async #apply(scene: GpuScene, wish: string | null, signal: AbortSignal): Promise<void> {
    try {
      const { goalOf, SceneEconomy } = await import('../economy/scene-economy.js');
      const goal = goalOf(wish, this.#options.warn);
      if (signal.aborted || (goal === null && this.#economy === undefined)) return;
      this.#economy ??= new SceneEconomy(scene);
      await this.#economy.apply(goal, this.#options.memoryBudget(), signal);
      if (!signal.aborted) this.#options.onChange();
    } catch (error) {
      if (signal.aborted || scene.isLost || scene.isDestroyed) return;
      const reason = error instanceof Error ? error.message : String(error);
      // Something else may be on show all the same: the whole, in place of what was asked for before.
      this.#options.onChange();
      this.#options.warn(`<gaussian-splat>: the scene stays as it is, since economy failed: ${reason}`);
    }
  }
}
