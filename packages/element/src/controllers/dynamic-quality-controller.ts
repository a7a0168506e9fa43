import type { PerFrameSettings } from '@gaussian-splat/renderer';
import type { WorkTime } from '@gaussian-splat/renderer/tools';
import { targetMsOf, type FrameScheduler } from '../gpu/frame-scheduler.js';
import { canFade, Fade, FADE_MS } from '../dynamic-quality/fade.js';
import { levelsForSize, QUALITY_LEVELS, type QualityLevel, type Losses } from '../dynamic-quality/quality-levels.js';
import { nextQuality, limited, resized } from '../dynamic-quality/next-quality.js';
import { lossesOf } from '../dynamic-quality/image-loss.js';
import { quantile } from '../dynamic-quality/display-interval.js';
import { INITIAL_QUALITY, waitForRest, type QualityState, type QualityReason } from '../dynamic-quality/start.js';

/** All that frames in motion may be drawn with. */
export const MOVING_SETTINGS: readonly Partial<PerFrameSettings>[] = QUALITY_LEVELS.flatMap(
  ({ settings }) => settings ?? [],
);

/** A change so soon after another, ms, belongs to the same motion. */
const MOTION_MS = 150;
/** Where frames take longer than that, a change within so many of them still does; at most ms. */
const FRAMES_OF_MOTION = 2;
const LONGEST_PAUSE_MS = 2_000;

/** Images of so many times the pixels are others: what levels take is measured anew. */
const OTHER_SIZE = 1.25;

/** How a frame is to be drawn. */
export interface FramePlan {
  /** Number of the level; 0 is the whole image. */
  readonly level: number;
  readonly settings: Partial<PerFrameSettings> | undefined;
  /** Number of the size that pictures have. */
  readonly size: number;
}

/** What is known of a frame before it is drawn. */
export interface FrameOccasion {
  /** requestAnimationFrame's clock, ms. */
  readonly now: number;
  /** Of the whole picture. */
  readonly pixels: number;
  /** It shows something else than the frame before: the camera has moved, or the scene has. */
  readonly hasChanged: boolean;
  /** The camera will go on moving. */
  readonly goesOn: boolean;
}

/** Draws the frame. @param onTime gets what it took */
export type DrawFrame = (settings: FramePlan['settings'], onTime?: (time: WorkTime) => void) => void;

/** What the controller says about itself. */
export interface DynamicQualityReport {
  /** Name of the level that the last frame was drawn with; `whole` is the image at rest. */
  readonly drawn: string;
  /** Name of the level of frames in motion. */
  readonly moving: string;
  /** Why: see {@link QualityReason}. */
  readonly reason: QualityReason;
  /** Median of the last frames on that level, ms: from when a frame could begin until its work was done; null while there are none. */
  readonly frameMs: number | null;
  /** The last frame that was timed, at rest or in motion, ms; null while there is none, and with a chosen quality. */
  readonly lastMs: number | null;
  /** What a frame may take, ms. */
  readonly targetMs: number;
}

export interface DynamicQualityOptions {
  /** False where the page has chosen a quality. */
  readonly isOn: () => boolean;
  readonly scheduler: () => FrameScheduler;
  /** What the page allows a frame, ms; infinite where the display says. */
  readonly frameBudget: () => number;
  readonly requestFrame: () => void;
  /** False where frames cost more than to be drawn: those of a post-processor. */
  readonly mayFade: () => boolean;
  /** Called for each frame of a motion that was timed: whether such are drawn whole. */
  readonly onFrameTimed: (isWhole: boolean) => void;
  /** Default: the element's. */
  readonly levels?: readonly QualityLevel[];
}

/**
 * Keeps moving pictures in time with the display: measures what frames take, and draws those in motion with as much as there is time for. A picture at
 * rest is the true image, 300 ms after the last motion where that takes 214 ms or less at 60 Hz.
 */
export class DynamicQualityController {
  readonly #options: DynamicQualityOptions;
  #state: QualityState = INITIAL_QUALITY;
  readonly #all: readonly QualityLevel[];
  /** Those that serve the image's size. */
  #levels: readonly QualityLevel[];
  /** Of the pictures that the pace has measured. */
  #pixels = 0;
  /** How many sizes pictures have had: frames of another one come late. */
  #size = 0;
  #changedAt = -Infinity;
  #drawn: QualityLevel;
  /** What the last frame took, of those that are known. */
  #lastMs: number | null = null;
  /** What the last true image took, of those that are known. */
  #wholeMs = 0;
  #restTimer: ReturnType<typeof setTimeout> | undefined;
  readonly #fade = new Fade();
  /** What fewer pixels lose of the scene as it was last seen; undefined while that is not known. */
  #losses: Losses | undefined;
  /** The search for it that goes on. */
  #measuring: Promise<Losses> | undefined;

  constructor(options: DynamicQualityOptions) {
    this.#options = options;
    this.#levels = this.#all = options.levels ?? QUALITY_LEVELS;
    this.#drawn = this.#all[0];
  }

  /** What a frame may take on the GPU, ms. */
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
   * Draws the next frame on a canvas. Coming to rest from fewer pixels, the last frame of the motion is drawn once more, since only what a task has drawn can be copied; the true
   * image, which follows, fades in from under the copy.
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
    // All pixels while it is not known what fewer lose.
    const isUnknown = this.#drawn.scale < 1 && !this.#losses;
    if (isUnknown) this.#drawn = this.#levels.findLast(({ scale }) => scale === 1)!;
    render(this.#drawn.settings, (time) => {
      if (plan.level === 0) this.#fade.start(canvas);
      if (!isUnknown) this.sample(plan, time);
    });
    if (this.#measuring) return;
    if (isUnknown || (plan.level === 0 && this.#state.level > 0)) this.#measure(canvas, occasion.pixels);
  }

  /** @returns whether the frame was one more of the motion */
  #settle(before: QualityLevel, canvas: HTMLCanvasElement, render: DrawFrame): boolean {
    if (this.#fade.isCovering || !canFade(canvas)) return false;
    this.#drawn = before;
    render(before.settings);
    if (!this.#fade.isAwaited) void this.#fade.cover(canvas).then(this.#options.requestFrame);
    return true;
  }

  /** Finds what fewer pixels lose of the frame just drawn. Where that cannot be found all levels serve. */
  #measure(canvas: HTMLCanvasElement, pixels: number): void {
    const scales = this.#all.flatMap(({ scale }) => (scale < 1 ? scale : []));
    const measuring = lossesOf(canvas, scales).catch((): Losses => new Map());
    this.#measuring = measuring;
    void measuring.then((losses) => {
      if (this.#measuring !== measuring) return;
      this.#measuring = undefined;
      this.#losses = losses;
      this.#fit(pixels);
    });
  }

  /**
   * How to draw the next frame. A single change after a rest is drawn whole at once; what goes on to change is in motion.
   */
  plan({ now, pixels, hasChanged, goesOn }: FrameOccasion): FramePlan {
    // What was found before the page chose a quality says nothing of what is drawn now.
    if (!this.#options.isOn()) this.reset();
    this.#fit(pixels);
    const pause = Math.max(
      MOTION_MS,
      Math.min(LONGEST_PAUSE_MS, FRAMES_OF_MOTION * Math.max(this.#lastMs ?? 0, this.#wholeMs)),
    );
    // Between two changes of one motion (a sequence of fewer pictures than the display's) what is drawn for other reasons is a part of it, until rest is due.
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

  /** What a frame took that was drawn by a plan. */
  sample({ level, size }: Pick<FramePlan, 'level' | 'size'>, { doneAt, atLeast, atMost }: WorkTime): void {
    if (!this.#options.isOn() || size !== this.#size) return;
    const { targetMs } = this;
    // What is in time at most, or too slow at least, is known well enough.
    if (atMost > targetMs && atLeast <= targetMs && atLeast < atMost) return;
    const milliseconds = atMost > targetMs ? atLeast : atMost;
    this.#lastMs = milliseconds;
    if (level === 0) this.#wholeMs = milliseconds;
    this.#state = nextQuality(this.#state, { now: doneAt, level, milliseconds }, { targetMs, levels: this.#levels });
    const isWhole = this.#state.level === 0;
    if (isWhole || level > 0) this.#options.onFrameTimed(isWhole);
  }

  /** Another scene, or another way to draw it: nothing is known. */
  reset(): void {
    this.stop();
    this.#state = INITIAL_QUALITY;
    this.#changedAt = -Infinity;
    this.#drawn = this.#all[0];
    this.#lastMs = null;
    this.#wholeMs = 0;
    this.#losses = this.#measuring = undefined;
  }

  /** No frame follows. */
  stop(): void {
    this.#cancelRest();
    this.#fade.end();
  }

  #cancelRest(): void {
    clearTimeout(this.#restTimer);
    this.#restTimer = undefined;
  }
}
