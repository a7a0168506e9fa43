import type { PerFrameSettings } from '@gaussian-splat/renderer';
import type { WorkTime } from '@gaussian-splat/renderer/tools';
import { targetMsOf, type FrameScheduler } from '../gpu/frame-scheduler.js';
import { canFade, Fade, FADE_MS } from '../dynamic-quality/fade.js';
import { levelsForSize, QUALITY_LEVELS, type QualityLevel, type Losses } from '../dynamic-quality/quality-levels.js';
import { nextQuality, limited, resized } from '../dynamic-quality/next-quality.js';
import { lossesOf } from '../dynamic-quality/image-loss.js';
import { quantile } from '../dynamic-quality/display-interval.js';
import { INITIAL_QUALITY, waitForRest, type QualityState, type QualityReason } from '../dynamic-quality/start.js';

/** All settings of frames in motion. */
export const MOVING_SETTINGS: readonly Partial<PerFrameSettings>[] = QUALITY_LEVELS.flatMap(
  ({ settings }) => settings ?? [],
);

/** Two changes within this time, ms, belong to the same motion. */
const MOTION_MS = 150;
/** For slow frames, two changes within this many frames do, too; upper limit in ms. */
const FRAMES_OF_MOTION = 2;
const LONGEST_PAUSE_MS = 2_000;

/** Images that differ in pixels by this factor invalidate the measured times. */
const OTHER_SIZE = 1.25;

/** Settings of the next frame. */
export interface FramePlan {
  /** Index of the level; 0 is full quality. */
  readonly level: number;
  readonly settings: Partial<PerFrameSettings> | undefined;
  /** Counter of the frame size. */
  readonly size: number;
}

/** State of a frame before it is drawn. */
export interface FrameOccasion {
  /** requestAnimationFrame's clock, ms. */
  readonly now: number;
  /** Pixels at full resolution. */
  readonly pixels: number;
  /** Whether it differs from the previous frame: the camera has moved, or the scene has. */
  readonly hasChanged: boolean;
  /** Whether the camera will continue to move. */
  readonly goesOn: boolean;
}

/** Draws the frame. @param onTime Is called with its duration. */
export type DrawFrame = (settings: FramePlan['settings'], onTime?: (time: WorkTime) => void) => void;

/** State of the controller for statistics. */
export interface DynamicQualityReport {
  /** Name of the level of the last frame; `whole` is full quality. */
  readonly drawn: string;
  /** Name of the level of frames in motion. */
  readonly moving: string;
  /** Reason: see {@link QualityReason}. */
  readonly reason: QualityReason;
  /**
   * Median of the last frames on that level, ms: from the earliest start of a frame until its work was done; null
   * without any.
   */
  readonly frameMs: number | null;
  /** The last timed frame, at rest or in motion, ms; null without one, and with a fixed quality. */
  readonly lastMs: number | null;
  /** Target duration of a frame, ms. */
  readonly targetMs: number;
}

export interface DynamicQualityOptions {
  /** False if the page has set a fixed quality. */
  readonly isOn: () => boolean;
  readonly scheduler: () => FrameScheduler;
  /** Upper limit of a frame from the page, ms; infinite if only the display limits it. */
  readonly frameBudget: () => number;
  readonly requestFrame: () => void;
  /** False if drawing again is expensive: for frames of a post-processor. */
  readonly mayFade: () => boolean;
  /** Called for each timed frame of a motion: whether frames are drawn at full quality. */
  readonly onFrameTimed: (isWhole: boolean) => void;
  /** Default: the element's. */
  readonly levels?: readonly QualityLevel[];
}

/**
 * Keeps frames in motion in time with the display: measures frame times, and adapts the quality of frames in motion. At
 * rest it draws the full-quality image, 300 ms after the last motion if that takes 214 ms or less at 60 Hz.
 */
export class DynamicQualityController {
  readonly #options: DynamicQualityOptions;
  #state: QualityState = INITIAL_QUALITY;
  readonly #all: readonly QualityLevel[];
  /** Levels for the image's size. */
  #levels: readonly QualityLevel[];
  /** Pixels of the measured frames. */
  #pixels = 0;
  /** Counter of frame sizes, because times of another size arrive late. */
  #size = 0;
  #changedAt = -Infinity;
  #drawn: QualityLevel;
  /** Duration of the last timed frame. */
  #lastMs: number | null = null;
  /** Duration of the last timed full-quality image. */
  #wholeMs = 0;
  #restTimer: ReturnType<typeof setTimeout> | undefined;
  readonly #fade = new Fade();
  /** Error of lower resolutions in the current view; undefined until it is measured. */
  #losses: Losses | undefined;
  /** The running measurement of it. */
  #measuring: Promise<Losses> | undefined;

  constructor(options: DynamicQualityOptions) {
    this.#options = options;
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
   * Draws the next frame on a canvas. Before the first full-quality image after a motion at lower resolution, the last
   * frame of the motion is drawn once more, because only a frame of the current task can be copied; the full-quality
   * image then fades in under the copy.
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
    // Uses full resolution until the error of lower ones is known.
    const isUnknown = this.#drawn.scale < 1 && !this.#losses;
    if (isUnknown) this.#drawn = this.#levels.findLast(({ scale }) => scale === 1)!;
    const drawn = new Promise<void>((resolve) =>
      render(this.#drawn.settings, (time) => {
        resolve();
        if (plan.level === 0) this.#fade.start(canvas);
        if (!isUnknown) this.sample(plan, time);
      }),
    );
    if (this.#measuring) return;
    if (isUnknown || (plan.level === 0 && this.#state.level > 0)) this.#measure(canvas, occasion.pixels, drawn);
  }

  /** @returns Whether the frame was another one of the motion. */
  #settle(before: QualityLevel, canvas: HTMLCanvasElement, render: DrawFrame): boolean {
    if (this.#fade.isCovering || !canFade(canvas)) return false;
    this.#drawn = before;
    render(before.settings);
    if (!this.#fade.isAwaited) void this.#fade.cover(canvas).then(this.#options.requestFrame);
    return true;
  }

  /** Measures the error of lower resolutions for the last frame. If that fails, all levels are used. */
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
   * Plans the next frame. A single change after a rest is drawn at full quality at once; continued changes are motion.
   */
  plan({ now, pixels, hasChanged, goesOn }: FrameOccasion): FramePlan {
    // Measurements from before a fixed quality are discarded.
    if (!this.#options.isOn()) this.reset();
    this.#fit(pixels);
    const pause = Math.max(
      MOTION_MS,
      Math.min(LONGEST_PAUSE_MS, FRAMES_OF_MOTION * Math.max(this.#lastMs ?? 0, this.#wholeMs)),
    );
    // Frames for other reasons between two changes of one motion (a sequence with a lower frame rate than the
    // display's) belong to it, until rest is due.
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

  /** Records the duration of a planned frame. */
  sample({ level, size }: Pick<FramePlan, 'level' | 'size'>, { doneAt, lowerBound, upperBound }: WorkTime): void {
    if (!this.#options.isOn() || size !== this.#size) return;
    const { targetMs } = this;
    // If only the bounds are known, they suffice: at most in time, or at least too slow.
    if (upperBound > targetMs && lowerBound <= targetMs && lowerBound < upperBound) return;
    const milliseconds = upperBound > targetMs ? lowerBound : upperBound;
    this.#lastMs = milliseconds;
    if (level === 0) this.#wholeMs = milliseconds;
    this.#state = nextQuality(this.#state, { now: doneAt, level, milliseconds }, { targetMs, levels: this.#levels });
    const isWhole = this.#state.level === 0;
    if (isWhole || level > 0) this.#options.onFrameTimed(isWhole);
  }

  /** Discards all measurements: the scene or the backend has changed. */
  reset(): void {
    this.stop();
    this.#state = INITIAL_QUALITY;
    this.#changedAt = -Infinity;
    this.#drawn = this.#all[0];
    this.#lastMs = null;
    this.#wholeMs = 0;
    this.#losses = this.#measuring = undefined;
  }

  /** Call when no frame follows. */
  stop(): void {
    this.#cancelRest();
    this.#fade.end();
  }

  #cancelRest(): void {
    clearTimeout(this.#restTimer);
    this.#restTimer = undefined;
  }
}
