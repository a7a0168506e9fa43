import { GaussianSplatError } from '@gaussian-splat/core';
import type { Attributes, DetailChoice } from '../../viewer/attributes.js';
import type { LoadedGaussians, OwnedGaussians } from '../../gpu/loaded-gaussians.js';
import type { LodSettings } from '../../gpu/backend.js';
import { buildLevels } from './build-levels.js';
import { LatestTask } from '../../viewer/latest-task.js';
import type { Services } from '../../viewer/element-host.js';

/**
 * Minimum number of splats of a scene for which levels are built automatically. In smaller scenes the number of splats
 * is not the bottleneck.
 */
const MIN_SPLATS = 50_000;
/**
 * Maximum number of splats of a scene for which levels are built automatically. Building reads all splats back and
 * merges them in CPU memory, about 150 bytes per splat.
 */
const MAX_SPLATS = 8_000_000;
/**
 * Duration of motion at reduced quality after which levels are built, ms. The first frames of a scene, and those after
 * a rest, are often slow, so shorter durations prove nothing.
 */
const MAX_SLOW_MS = 1_500;
/**
 * Maximum interval between two frames of the same motion, ms. Longer intervals are rests, which do not count as slow
 * motion.
 */
const LONGEST_GAP_MS = 1_000;

/** Interface of the element for the controller of levels of detail. */
export interface DetailHost {
  readonly attributes: Pick<Attributes, 'detail'>;
  readonly services: Pick<Services, 'sceneLoader'>;
  readonly memoryBudget: number | undefined;
  /** Requests another frame. */
  splatsChanged(): void;
  readonly owner: { warn(sentence: string): void };
}

/**
 * Manages the levels of detail of a scene, and sets their allowed error. Builds levels when the page requests them, or
 * when frames in motion cannot be drawn at full quality.
 */
export class DetailController {
  readonly #host: DetailHost;
  #scene: LoadedGaussians | null = null;
  /** Detail settings that the scene was loaded with; empty for a scene without its own levels. */
  #own: LodSettings = {};
  /** Splats whose levels are built, are being built, or cannot be built. */
  #of: OwnedGaussians | undefined;
  readonly #building = new LatestTask();
  #choice: DetailChoice = 'auto';
  #isPressed = false;
  /** Duration of consecutive motion at reduced quality, ms. */
  #slowMs = 0;
  /** Time of the last reported frame in motion, in milliseconds of `performance.now()`. */
  #sampledAt = 0;

  constructor(host: DetailHost) {
    this.#host = host;
  }

  /**
   * Applies a completely loaded scene, null if there is none, and the attribute `detail`. May be called at any rate:
   * only changes have an effect.
   */
  update(scene: LoadedGaussians | null): void {
    if (scene !== this.#scene) this.#begin(scene);
    if (scene === null || scene.isDestroyed || scene.live !== undefined || !scene.can('levels')) return;
    this.#setThreshold(scene, this.#host.attributes.detail);
    if (scene.hasOwnLevels) return;
    if (this.#choice === 'off') return this.#dismiss(scene);
    if (this.#of === scene.gaussians || !this.#isWorthIt(scene)) return;
    this.#build(scene);
  }

  /** Call for each timed frame in motion. `isWhole`: whether frames in motion are drawn at full quality. */
  reportMotionFrame(isWhole: boolean): void {
    const gap = performance.now() - this.#sampledAt;
    this.#sampledAt += gap;
    if (isWhole) this.#slowMs = 0;
    else if (gap < LONGEST_GAP_MS) this.#slowMs += gap;
    if (this.#isPressed || this.#slowMs < MAX_SLOW_MS) return;
    this.#isPressed = true;
    if (this.#scene) this.update(this.#scene);
  }

  #begin(scene: LoadedGaussians | null): void {
    this.#stop();
    this.#slowMs = 0;
    this.#isPressed = false;
    this.#scene = scene;
    this.#own = scene?.detail ?? {};
    this.#choice = 'auto';
  }

  #stop(): void {
    this.#building.renew();
    this.#of = undefined;
  }

  /** Sets the allowed error of subsequent frames, in pixels, if the choice has changed. */
  #setThreshold(scene: LoadedGaussians, choice: DetailChoice): void {
    if (choice === this.#choice) return;
    this.#choice = choice;
    const pixels = choice === 'auto' ? this.#own.detail : choice === 'off' ? 0 : choice;
    scene.setDetail({ ...scene.detail, detail: pixels });
    this.#host.splatsChanged();
  }

  #dismiss(scene: LoadedGaussians): void {
    this.#stop();
    scene.setLevels(undefined);
  }

  #isWorthIt({ gaussians: { count } }: LoadedGaussians): boolean {
    if (typeof this.#choice === 'number') return this.#choice > 0;
    return this.#isPressed && count >= MIN_SPLATS && count <= MAX_SPLATS;
  }

  #build(scene: LoadedGaussians): void {
    const { gaussians } = scene;
    this.#of = gaussians;
    this.#building.run(
      async (signal) => {
        const levels = await buildLevels(scene, this.#host.services.sceneLoader, this.#host.memoryBudget, signal);
        // A sequence may have replaced the splats during the build.
        if (scene.isDestroyed || scene.gaussians !== gaussians) return levels?.destroy();
        scene.setLevels(levels);
        this.#host.splatsChanged();
      },
      (error) => {
        if (scene.place.isLost || scene.isDestroyed || scene.gaussians !== gaussians) return;
        // If the code could not be loaded, the next update tries again.
        if (error instanceof GaussianSplatError && error.code === 'network/unreachable') this.#of = undefined;
        const reason = error instanceof Error ? error.message : String(error);
        this.#host.owner.warn(
          `<gaussian-splat>: the scene has no levels of detail, since building them failed: ${reason}`,
        );
      },
    );
  }
}
