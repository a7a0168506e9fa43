import { GaussianSplatError } from '@gaussian-splat/core';
import type { Attributes, DetailChoice } from '../attributes.js';
import type { LoadedGaussians, OwnedGaussians } from '../gpu/loaded-gaussians.js';
import type { LodSettings } from '../gpu/painter.js';
import { buildLevels } from '../detail/build-levels.js';
import { LatestTask } from '../latest-task.js';
import type { Services } from '../stage-host.js';

/** Splats of a scene from which on levels are worth building unasked: below, what is slow is not the number of splats. */
const LEAST_SPLATS = 50_000;
/** Splats up to which they are built unasked: all of them are read back and merged in the page's memory, some 150 bytes of each. */
const MOST_SPLATS = 8_000_000;
/** How long pictures must have moved with less than the whole before levels are built, ms: the first frames of a scene, and those after a rest, are often slow. */
const MAX_SLOW_MS = 1_500;
/** Time between two frames of one motion, ms: what is longer is a rest, and does not count. */
const LONGEST_GAP_MS = 1_000;

/** What the controller needs of its element. */
export interface DetailHost {
  readonly attributes: Pick<Attributes, 'detail'>;
  readonly services: Pick<Services, 'sceneLoader'>;
  readonly memoryBudget: number | undefined;
  /** Another picture is due. */
  splatsChanged(): void;
  warn(sentence: string): void;
}

/** Sees to levels of detail: built when the page asks for them, or when pictures in motion cannot be drawn whole; and drawn as far as the page allows. */
export class DetailController {
  readonly #host: DetailHost;
  #scene: LoadedGaussians | null = null;
  /** What a streamed scene came with. */
  #own: LodSettings = {};
  /** Splats whose levels are there, on their way, or not to be had. */
  #of: OwnedGaussians | undefined;
  readonly #building = new LatestTask();
  #choice: DetailChoice = 'auto';
  #isPressed = false;
  /** How long pictures have moved with less than the whole, ms. */
  #slowMs = 0;
  /** When the last picture in motion was told of. */
  #noted = 0;

  constructor(host: DetailHost) {
    this.#host = host;
  }

  /** Looks at the scene that is on show whole, or null for none, and at the attribute. Safe to call as often as one likes. */
  update(scene: LoadedGaussians | null): void {
    if (scene !== this.#scene) this.#begin(scene);
    if (scene === null || scene.isDestroyed || scene.live !== undefined) return;
    this.#setThreshold(scene, this.#host.attributes.detail);
    if (scene.hasOwnLevels) return;
    if (this.#choice === 'off') return this.#dismiss(scene);
    if (this.#of === scene.gaussians || !this.#isWorthIt(scene)) return;
    this.#build(scene);
  }

  /** Tells of each picture in motion whether it was drawn whole. */
  reportMotionFrame(isWhole: boolean): void {
    const gap = performance.now() - this.#noted;
    this.#noted += gap;
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

  /** Lets pictures be off by so much from now on. */
  #setThreshold(scene: LoadedGaussians, choice: DetailChoice): void {
    if (choice === this.#choice) return;
    this.#choice = choice;
    const pixels = choice === 'auto' ? this.#own.detail : choice === 'off' ? 0 : choice;
    scene.setDetail({ ...this.#own, detail: pixels });
    this.#host.splatsChanged();
  }

  #dismiss(scene: LoadedGaussians): void {
    this.#stop();
    scene.setLevels(undefined);
  }

  #isWorthIt({ gaussians: { count } }: LoadedGaussians): boolean {
    if (typeof this.#choice === 'number') return this.#choice > 0;
    return this.#isPressed && count >= LEAST_SPLATS && count <= MOST_SPLATS;
  }

  #build(scene: LoadedGaussians): void {
    const { gaussians } = scene;
    this.#of = gaussians;
    this.#building.run(
      async (signal) => {
        const levels = await buildLevels(scene, this.#host.services.sceneLoader, this.#host.memoryBudget, signal);
        // A sequence may have put other splats in their place meanwhile.
        if (scene.isDestroyed || scene.gaussians !== gaussians) return levels?.destroy();
        scene.setLevels(levels);
        this.#host.splatsChanged();
      },
      (error) => {
        if (scene.isLost || scene.isDestroyed || scene.gaussians !== gaussians) return;
        // Code that could not be fetched is asked for again at the next update.
        if (error instanceof GaussianSplatError && error.code === 'network/unreachable') this.#of = undefined;
        const reason = error instanceof Error ? error.message : String(error);
        this.#host.warn(`<gaussian-splat>: the scene has no levels of detail, since building them failed: ${reason}`);
      },
    );
  }
}
