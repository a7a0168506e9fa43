/** Estimates the capacity that the next frames need from the need of earlier frames. */

/** Capacity of the buffers between the stages, or the need of a frame. */
export interface Capacity {
  /** Number of visible splats in one frame. */
  readonly visible: number;
  /** Number of pairs of splat and bin for the rasterizer `tiles`. */
  readonly pairs: number;
}

/** Number of samples with excess capacity before the buffers shrink. */
const SAMPLES_BEFORE_SHRINK = 4;
/**
 * Factor of the number of samples before a shrink, each time the buffers grow after one. Views that alternate, such as
 * those of an orbit, soon keep the largest capacity.
 */
const SAMPLES_GROWTH = 4;
/** Maximum milliseconds between two samples that are assumed to show about the same view. */
const SAME_VIEW_MS = 1_000;
/**
 * Exponents of the need of a frame as a power of its pixels, if no measurement is available. Scenes with levels of
 * detail show more splats. Pairs grow with an exponent from 0.1 (far away) to 0.6 (close up).
 */
const EXPONENTS: Capacity = { visible: 0.25, pairs: 0.5 };
/** Upper limit of the factor that motion settings alone cause, beyond the ratio of pixels. */
const MAX_MOTION_SHARE = 2;

const NOTHING: Capacity = { visible: 0, pairs: 0 };

/** Returns a capacity that suffices for both. */
export const larger = (a: Capacity, b: Capacity): Capacity => ({
  visible: Math.max(a.visible, b.visible),
  pairs: Math.max(a.pairs, b.pairs),
});

/** Size and kind of a sampled frame. */
export interface SampledFrame {
  /** Number of drawn pixels. */
  readonly pixels: number;
  /** Number of pixels of the target at full resolution. */
  readonly wholePixels: number;
  /** Whether the frame was drawn with the settings at rest. */
  readonly isWhole: boolean;
}

interface CountSample extends SampledFrame {
  /** Visible splats and pairs of the frame, which the capacity must cover. */
  readonly used: Capacity;
  /** Time of the sample in milliseconds, as `performance.now()` returns. */
  readonly at: number;
}

/**
 * Ratios of the frame at rest to the frame in motion, from the last measurement of both: of their pixels and of their
 * needs.
 */
interface Ratio {
  readonly pixels: number;
  readonly need: Capacity;
}

/**
 * History of the capacity of a scene. It determines how long excess capacity is kept, and estimates the need at rest
 * while only frames in motion are measured.
 */
export class CapacityHistory {
  #looks = SAMPLES_BEFORE_SHRINK;
  #hasShrunk = false;
  #whole = { pixels: 0, need: NOTHING };
  #last: CountSample | undefined;
  #ratio: Ratio = { pixels: 1, need: { visible: 1, pairs: 1 } };

  /** Number of samples with excess capacity before the buffers shrink. */
  get looks(): number {
    return this.#looks;
  }

  /** Records that the buffers were made smaller. */
  shrink(): void {
    this.#hasShrunk = true;
  }

  /** Records that the buffers were made larger. */
  grow(): void {
    if (this.#hasShrunk) this.#looks *= SAMPLES_GROWTH;
    this.#hasShrunk = false;
  }

  /** Records a sample. Samples of the same view at rest and in motion, at most 1 s apart, update the measured ratio. */
  note(sample: CountSample): void {
    const last = this.#last;
    this.#last = sample;
    if (sample.isWhole) this.#whole = { pixels: sample.pixels, need: sample.used };
    const isNew = last?.isWhole !== sample.isWhole && last?.wholePixels === sample.wholePixels;
    if (!isNew || sample.at - last.at > SAME_VIEW_MS) return;
    const [less, whole] = sample.isWhole ? [last, sample] : [sample, last];
    const ratioOf = (key: keyof Capacity): number => whole.used[key] / Math.max(1, less.used[key]);
    this.#ratio = {
      pixels: whole.pixels / less.pixels,
      need: { visible: ratioOf('visible'), pairs: ratioOf('pairs') },
    };
  }

  /** Estimated need at rest of the view that was sampled last; undefined before the first sample. */
  get lastNeed(): Capacity | undefined {
    return this.#last && this.wholeNeedBy(this.#last);
  }

  /** Returns the need of the last sampled frame at rest if it had this many pixels; otherwise zeros. */
  wholeNeed(pixels: number): Capacity {
    return pixels === this.#whole.pixels ? this.#whole.need : NOTHING;
  }

  /** Estimates the need of the same view at rest, from the ratio measured when motion last ended or began. */
  wholeNeedBy({ pixels, wholePixels, isWhole, used }: Omit<CountSample, 'at'>): Capacity {
    if (isWhole) return used;
    const { pixels: seen, need } = this.#ratio;
    const times = wholePixels / pixels;
    const estimate = (key: keyof Capacity): number => {
      const ratio = need[key] * (times / seen) ** EXPONENTS[key];
      return Math.ceil(used[key] * Math.max(1, Math.min(MAX_MOTION_SHARE * times, ratio)));
    };
    return { visible: estimate('visible'), pairs: estimate('pairs') };
  }
}
