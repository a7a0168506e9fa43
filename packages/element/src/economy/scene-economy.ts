/** Loaded only where a page asks for economy. */
import {
  LiveMask,
  lookAround,
  parseEconomyGoal,
  visibleSetsDecibels,
  type EconomyGoal,
  type MaskGoal,
} from '@gaussian-splat/economise';
import { GaussianBuffers, type SidedGaussians } from '@gaussian-splat/renderer';
import type { EconomyReport } from '../controllers/economy-controller.js';
import { isGone } from '../gpu/device-failures.js';
import type { GpuScene, OwnedGaussians } from '../gpu/gpu-scene.js';

/** What the element's core knows of this module. */
export type Economy = SceneEconomy;

/** 100 %, as a share or a percentage. */
const ALL = /^\s*(1(\.0*)?|100(\.0*)?\s*%)\s*$/;

/** What the attribute asks for, null for all of the scene; what is none of its words is told to `warn`. */
export function goalOf(wish: string | null, warn: (sentence: string) => void): EconomyGoal | null {
  const goal = parseEconomyGoal(wish);
  if (goal === null && wish !== null && !ALL.test(wish))
    warn(
      `<gaussian-splat>: economy expects a share such as 60%, dB such as 57db, or views, found ${JSON.stringify(wish)}.`,
    );
  return goal;
}

/** A scene on show, of which what no view needs can be left out, and taken back. */
export class SceneEconomy {
  readonly #scene: GpuScene;
  readonly #gone = new AbortController();
  /** Once a mask was asked for: all splats in the page's memory. Those that it leaves out take none on the GPU. */
  #mask: Promise<LiveMask> | undefined;
  #isMasked = false;
  /** What is on show, while each view leaves out what does not show from its side. */
  #sided: SidedGaussians<OwnedGaussians> | undefined;
  #report = WHOLE;

  constructor(scene: GpuScene) {
    this.#scene = scene;
    // A scene that is taken away meanwhile has no buffers any more.
    scene.onDestroy = () => this.#gone.abort();
  }

  /** What is left out of what is on show, whatever was asked for last. */
  get report(): EconomyReport {
    return this.#report;
  }

  /**
   * Shows what the goal leaves of the scene, null for all of it. Looking at a large scene takes seconds, beside the frames. Rejects with the signal's reason, or
   * GaussianSplatError `out-of-memory/*`.
   */
  async apply(goal: EconomyGoal | null, memoryBudget: number | undefined, signal: AbortSignal): Promise<void> {
    const either = AbortSignal.any([signal, this.#gone.signal]);
    try {
      await this.#show(goal, memoryBudget, either);
    } catch (error) {
      // Whoever asked looks at it then.
      await isGone(this.#scene);
      throw error;
    }
  }

  async #show(goal: EconomyGoal | null, memoryBudget: number | undefined, signal: AbortSignal): Promise<void> {
    if (goal === 'views') return this.#showByView(memoryBudget, signal);
    this.#forgetSides();
    return goal === null ? this.#showWhole(memoryBudget, signal) : this.#showMasked(goal, memoryBudget, signal);
  }

  async #showByView(memoryBudget: number | undefined, signal: AbortSignal): Promise<void> {
    const { device, bounds } = this.#scene;
    await this.#showWhole(memoryBudget, signal);
    if (this.#sided) return;
    const { gaussians } = this.#scene;
    const left = memoryBudget === undefined ? undefined : memoryBudget - gaussians.byteLength;
    const sided = await lookAround(device, gaussians, bounds, { signal, memoryBudget: left });
    try {
      const decibels = await visibleSetsDecibels(device, sided, bounds, { signal });
      if (decibels < LEAST_DECIBELS) throw new Error(tooFar(decibels));
      signal.throwIfAborted();
      this.#scene.replaceGaussians(sided, 'kept');
      this.#sided = sided;
      this.#report = { spared: 0, decibels, byView: true };
    } catch (error) {
      sided.release();
      throw error;
    }
  }

  #forgetSides(): void {
    if (this.#sided === undefined || this.#scene.isDestroyed) return;
    this.#scene.replaceGaussians(this.#sided.whole, 'kept');
    this.#sided.release();
    this.#sided = undefined;
    this.#report = WHOLE;
  }

  async #showWhole(memoryBudget: number | undefined, signal: AbortSignal): Promise<void> {
    if (!this.#isMasked) return;
    const { whole } = await this.#mask!;
    this.#put(await GaussianBuffers.upload(this.#scene.device, whole, { memoryBudget }), signal);
    this.#isMasked = false;
    this.#report = WHOLE;
  }

  async #showMasked(goal: MaskGoal, memoryBudget: number | undefined, signal: AbortSignal): Promise<void> {
    this.#mask ??= this.#look();
    const mask = await this.#mask;
    signal.throwIfAborted();
    const { packed, decibels } = await mask.masked(goal, signal);
    const { whole } = mask;
    this.#put(await GaussianBuffers.upload(this.#scene.device, packed, { memoryBudget }), signal);
    this.#isMasked = true;
    this.#report = { spared: whole.count - packed.count, decibels, byView: false };
  }

  /** Looks at the scene once, for whatever is asked of it later; again only where that failed. */
  async #look(): Promise<LiveMask> {
    const { device, gaussians, bounds } = this.#scene;
    try {
      return await LiveMask.of(device, gaussians, bounds, { signal: this.#gone.signal });
    } catch (error) {
      this.#mask = undefined;
      throw error;
    }
  }

  /** Other splats in place of those on show, unless they come too late. */
  #put(gaussians: GaussianBuffers, signal: AbortSignal): void {
    if (signal.aborted) gaussians.destroy();
    signal.throwIfAborted();
    this.#scene.replaceGaussians(gaussians);
  }
}

const WHOLE: EconomyReport = { spared: 0, decibels: null, byView: false };
/** What `balanced`, the best quality that leaves out what does not show, is held to. */
const LEAST_DECIBELS = 42;

const tooFar = (decibels: number): string =>
  `views around the scene hide so much of it from one another that leaving it out would keep ${decibels.toFixed(1)} dB, fewer than ${LEAST_DECIBELS}`;
