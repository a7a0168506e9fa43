import type { PerFrameSettings } from '@gaussian-splat/renderer';
import type { WorkTime } from '@gaussian-splat/renderer/tools';
import { targetMsOf, type FrameScheduler } from '../gpu/frame-scheduler.js';
import { canFade, Fade, FADE_MS } from './fade.js';
import { levelsForSize, QUALITY_LEVELS, type QualityLevel, type Losses } from './quality-levels.js';
import { MEMORY, nextQuality, limited, resized, usualOf } from './next-quality.js';
import { lossesOf } from './image-loss.js';
import { quantile } from './display-interval.js';
import { SplatBudgets, type BudgetedScene } from './splat-budgets.js';
import { INITIAL_QUALITY, waitForRest, type QualityState, type QualityReason } from './start.js';

/** Settings of all quality levels of frames in motion, for which pipelines are prepared. */
export const MOVING_SETTINGS: readonly Partial<PerFrameSettings>[] = QUALITY_LEVELS.flatMap(
  ({ settings }) => settings ?? [],
);

/** Maximum interval between two changes of the same motion, ms; for slow frames it is longer. */
const MOTION_MS = 150;
/**
 * Number of frames within which two changes belong to the same motion if frames are slow. The second constant limits
 * this interval, ms.
 */
const FRAMES_OF_MOTION = 2;
const LONGEST_PAUSE_MS = 2_000;

/** Factor by which the number of pixels must change to invalidate the measured times. */
const OTHER_SIZE = 1.25;

/** Level and settings that are planned for the next frame. */
export interface FramePlan {
  /** Index of the quality level; 0 is full quality. */
  readonly level: number;
  readonly settings: Partial<PerFrameSettings> | undefined;
  /** Number of changes of the frame size until this frame. A time of an older size is discarded. */
  readonly size: number;
}

/** Properties of a frame that determine its quality. */
export interface FrameOccasion {
  /** requestAnimationFrame's clock, ms. */
  readonly now: number;
  /** Number of pixels at full resolution. */
  readonly pixels: number;
  /** Whether the frame differs from the previous one, because the camera or the scene has moved. */
  readonly hasChanged: boolean;
  /** Whether the camera will continue to move after this frame. */
  readonly goesOn: boolean;
}

/**
 * Draws a frame with settings; undefined for full quality. `onTime` is called with the duration of the frame when its
 * work is done.
 */
export type DrawFrame = (settings: FramePlan['settings'], onTime?: (time: WorkTime) => void) => void;

/** State of the controller for statistics. */
export interface DynamicQualityReport {
  /** Name of the quality level of the last frame; `whole` is full quality. */
  readonly drawn: string;
  /** Name of the quality level that frames in motion have. */
  readonly moving: string;
  /** Reason for the level of frames in motion. */
  readonly reason: QualityReason;
  /**
   * Median duration of the last frames on the level `moving`, ms; null before the first. A duration lasts from the
   * earliest possible start of the GPU work of a frame until its end.
   */
  readonly frameMs: number | null;
  /** Duration of the last timed frame, at rest or in motion, ms. Null before the first, and with a fixed quality. */
  readonly lastMs: number | null;
  /** Target duration of a frame, ms. */
  readonly targetMs: number;
}

export interface DynamicQualityOptions {
  /** Whether the quality is adapted; false if the page has set a fixed quality. */
  readonly isOn: () => boolean;
  readonly scheduler: () => FrameScheduler;
  /** Maximum duration of a frame that the page allows, ms; Infinity if only the display limits it. */
  readonly frameBudget: () => number;
  readonly requestFrame: () => void;
  /**
   * Whether the full-quality image may fade in. False if drawing a frame again is expensive, as with a post-processor.
   */
  readonly mayFade: () => boolean;
  /** Called for each timed frame of a motion. `isWhole`: whether frames in motion are drawn at full quality. */
  readonly onFrameTimed: (isWhole: boolean) => void;
  /** Returns the scenes that are drawn. The splat budgets of streamed ones follow the time of frames. Default: none. */
  readonly scenes?: () => readonly BudgetedScene[];
  /** Levels from which the controller chooses; default: {@link QUALITY_LEVELS}. */
  readonly levels?: readonly QualityLevel[];
}

/**
 * Adapts the quality of frames in motion so that they keep up with the display, from measured frame times. At rest the
 * full-quality image is drawn: 300 ms after the last motion, if its drawing takes at most 214 ms at 60 Hz.
 */
export class DynamicQualityController {
  readonly #options: DynamicQualityOptions;
  readonly #budgets: SplatBudgets;
  #state: QualityState = INITIAL_QUALITY;
  readonly #all: readonly QualityLevel[];
  /** Levels that suit the number of pixels and the measured errors. */
  #levels: readonly QualityLevel[];
  /** Number of pixels, at full resolution, of the measured frames. */
  #pixels = 0;
  /** Number of changes of the frame size, because times of frames of the previous size may arrive late. */
  #size = 0;
  #changedAt = -Infinity;
  #drawn: QualityLevel;
  /** Duration of the last timed frame, ms; null before the first. */
  #lastMs: number | null = null;
  /** Duration of the last timed full-quality image, ms; 0 before the first. */
  #wholeMs = 0;
  #restTimer: ReturnType<typeof setTimeout> | undefined;
  readonly #fade = new Fade();
  /** Measured errors of lower resolutions in the current view; undefined before they are measured. */
  #losses: Losses | undefined;
  /** The running measurement of these errors; undefined if none runs. */
  #measuring: Promise<Losses> | undefined;

  constructor(options: DynamicQualityOptions) {
    this.#options = options;
    this.#budgets = new SplatBudgets(options.scenes ?? (() => []));
    this.#levels = this.#all = options.levels ?? QUALITY_LEVELS;
    this.#drawn = this.#all[0];
  }

  /** Target GPU duration of a frame, ms. */
  get targetMs(): number {
    return targetMsOf(this.#options.frameBudget(), this.#options.scheduler());
  }

  get report(): DynamicQualityReport {
    const { level, reason, recent } = this.#state;
    const frameMs = recent.length > 0 ? quantile(recent, 0.5) : null;
    return {
      drawn: this.#drawn.name,
      moving: this.#levels[level].name,
      reason,
      frameMs,
      lastMs: this.#lastMs,
      targetMs: this.targetMs,
    };
  }

  /**
   * Draws the next frame on a canvas. A full-quality image after a motion at lower resolution fades in under a copy of
   * the last frame of the motion. Because only a frame of the current task can be copied, that frame is drawn once more
   * before.
   */
  draw(occasion: FrameOccasion, canvas: HTMLCanvasElement, render: DrawFrame): void {
    if (!this.#options.isOn()) {
      this.reset();
      return render(undefined);
    }
    const before = this.#drawn;
    const plan = this.plan(occasion);
    if (occasion.hasChanged || !this.#options.mayFade()) this.#fade.end();
    else if (plan.level === 0 && before.scale < 1 && this.#settle(before, canvas, render)) return;
    // Uses full resolution until the errors of lower resolutions are known.
    const isUnknown = this.#drawn.scale < 1 && !this.#losses;
    if (isUnknown) this.#drawn = this.#levels.findLast(({ scale }) => scale === 1)!;
    let resolve!: () => void;
    const drawn = new Promise<void>((done) => (resolve = done));
    // Not in the executor of the promise, which would keep the errors of the renderer.
    render(this.#drawn.settings, (time) => {
      resolve();
      if (plan.level === 0) this.#fade.start(canvas);
      if (!isUnknown) this.sample(plan, time);
    });
    if (this.#measuring) return;
    if (isUnknown || (plan.level === 0 && this.#state.level > 0)) this.#measure(canvas, occasion.pixels, drawn);
  }

  /**
   * Draws the last frame of the motion once more, and copies it as a cover for the fade. @returns False if the
   * full-quality image can be drawn now, because a cover exists or fades are unsupported.
   */
  #settle(before: QualityLevel, canvas: HTMLCanvasElement, render: DrawFrame): boolean {
    if (this.#fade.isCovering || !canFade(canvas)) return false;
    this.#drawn = before;
    render(before.settings);
    if (!this.#fade.isAwaited) void this.#fade.cover(canvas).then(this.#options.requestFrame);
    return true;
  }

  /** Measures the errors of lower resolutions for the last frame. If the measurement fails, all levels are used. */
  #measure(canvas: HTMLCanvasElement, pixels: number, drawn: Promise<unknown>): void {
    const scales = this.#all.flatMap(({ scale }) => (scale < 1 ? scale : []));
    const measuring = lossesOf(canvas, scales, drawn).catch((): Losses => new Map());
    this.#measuring = measuring;
    void measuring.then((losses) => {
      if (this.#measuring !== measuring) return;
      this.#measuring = undefined;
      this.#losses = losses;
      this.#fit(pixels);
    });
  }

  /**
   * Chooses the level of the next frame. A single change after a rest is drawn at full quality at once; changes in
   * succession are a motion.
   */
  plan({ now, pixels, hasChanged, goesOn }: FrameOccasion): FramePlan {
    // While the quality is fixed, measurements are discarded, because they become outdated.
    if (!this.#options.isOn()) this.reset();
    this.#fit(pixels);
    const pause = Math.max(
      MOTION_MS,
      Math.min(LONGEST_PAUSE_MS, FRAMES_OF_MOTION * Math.max(this.#lastMs ?? 0, this.#wholeMs)),
    );
    // Frames without a change may occur between two changes of a motion, as in a sequence with a lower frame rate than
    // the display's. They belong to the motion until the image at rest is due.
    const isMotion = hasChanged ? goesOn || now - this.#changedAt < pause : this.#restTimer !== undefined;
    if (hasChanged) this.#changedAt = now;
    const level = isMotion ? this.#state.level : 0;
    this.#drawn = this.#levels[level];
    if (hasChanged || level === 0) this.#cancelRest();
    const { displayInterval } = this.#options.scheduler();
    if (level > 0) this.#restTimer ??= setTimeout(this.#rest, waitForRest(this.#wholeMs + FADE_MS, displayInterval));
    return { level, settings: this.#drawn.settings, size: this.#size };
  }

  #fit(pixels: number): void {
    const isOther = Math.max(pixels, this.#pixels) > OTHER_SIZE * Math.min(pixels, this.#pixels);
    if (isOther) this.#losses = this.#measuring = undefined;
    const levels = levelsForSize(pixels, this.#all, this.#losses);
    const isLimit = !isOther && this.#losses !== undefined;
    if (!isOther && levels.length === this.#levels.length) return;
    this.#levels = levels;
    this.#state = isLimit ? limited(this.#state, levels) : resized(this.#state, pixels / this.#pixels, levels);
    if (isLimit) return;
    this.#pixels = pixels;
    this.#size++;
  }

  readonly #rest = (): void => {
    this.#restTimer = undefined;
    this.#options.requestFrame();
  };

  /** Records the duration of a frame that {@link plan} has planned, and chooses the next level of frames in motion. */
  sample({ level, size }: Pick<FramePlan, 'level' | 'size'>, { doneAt, lowerBound, upperBound }: WorkTime): void {
    if (!this.#options.isOn() || size !== this.#size) return;
    const { targetMs } = this;
    // The exact duration may be unknown. Its bounds suffice if the upper one is within the target, or the lower one
    // exceeds it.
    if (upperBound > targetMs && lowerBound <= targetMs && lowerBound < upperBound) return;
    const milliseconds = upperBound > targetMs ? lowerBound : upperBound;
    this.#lastMs = milliseconds;
    if (level === 0) this.#wholeMs = milliseconds;
    const next = nextQuality(this.#state, { now: doneAt, level, milliseconds }, { targetMs, levels: this.#levels });
    this.#state = this.#spend(next, doneAt) ?? next;
    const isWhole = this.#state.level === 0;
    if (isWhole || level > 0) this.#options.onFrameTimed(isWhole);
  }

  /**
   * Lets splat budgets follow the times of full-quality frames. They grow with the headroom, and fall before the quality
   * does. @returns The state that replaces `next`, without times of frames with other budgets; undefined if no budget has
   * changed.
   */
  #spend(next: QualityState, now: number): QualityState | undefined {
    const { level } = this.#state;
    const { recent } = next.level > 0 ? this.#state : next;
    if (level > 0 || recent.length === 0) return undefined;
    const time = { now, milliseconds: usualOf(recent), targetMs: this.targetMs };
    const isChanged =
      next.level > 0 ? this.#budgets.shrink(time) : recent.length === MEMORY && this.#budgets.grow(time);
    if (!isChanged) return undefined;
    this.#options.requestFrame();
    return { ...this.#state, recent: [], smoothedMs: 0 };
  }

  /** Discards all measurements. Call when the scene or the backend has changed. */
  reset(): void {
    this.stop();
    this.#state = INITIAL_QUALITY;
    this.#changedAt = -Infinity;
    this.#drawn = this.#all[0];
    this.#lastMs = null;
    this.#wholeMs = 0;
    this.#losses = this.#measuring = undefined;
  }

  /** Ends the fade, cancels the image at rest, and resets splat budgets. Call when no frame follows. */
  stop(): void {
    this.#cancelRest();
    this.#budgets.reset();
    this.#fade.end();
  }

  #cancelRest(): void {
    clearTimeout(this.#restTimer);
    this.#restTimer = undefined;
  }
}
