/** Capacity that frames have needed, as an estimate for the next ones. */

/** Capacity of the buffers between the stages. */
export interface Capacity {
  /** Splats visible in one frame. */
  readonly visible: number;
  /** Pairs of splat and bin for the tiles. */
  readonly pairs: number;
}

/** Samples with excess capacity before the buffers shrink. */
const SAMPLES_BEFORE_SHRINK = 4;
/**
 * Factor of that number each time the buffers had to grow again: views that alternate, such as those of an orbit, soon
 * keep the largest capacity.
 */
const SAMPLES_GROWTH = 4;
/** Two samples within this time, ms, are taken to show about the same view. */
const SAME_VIEW_MS = 1_000;
/**
 * A frame's need grows with its pixels to these powers, if no measurement is available: LOD scenes show more splats,
 * and pairs grow (0.1 from far away, 0.6 close up).
 */
const EXPONENTS: Capacity = { visible: 0.25, pairs: 0.5 };
/** Upper limit of the factor that the settings of motion alone cause, beyond the ratio of pixels. */
const MAX_MOTION_SHARE = 2;

const NOTHING: Capacity = { visible: 0, pairs: 0 };

/** The frame of a sample. */
export interface SampledFrame {
  /** Its pixels. */
  readonly pixels: number;
  /** Pixels of the frame at rest. */
  readonly wholePixels: number;
  /** Whether it was drawn with the settings at rest. */
  readonly isWhole: boolean;
}

interface CountSample extends SampledFrame {
  readonly used: Capacity;
  readonly at: number;
}

/**
 * Ratios between the frame at rest and the frame in motion: of their needs, and of their pixels when these were
 * measured.
 */
interface Ratio {
  readonly pixels: number;
  readonly need: Capacity;
}

/**
 * History of a scene's capacity: how long excess capacity is kept, and the need of the frame at rest while only frames
 * in motion are measured.
 */
export class CapacityHistory {
  #looks = SAMPLES_BEFORE_SHRINK;
  #hasShrunk = false;
  #whole = { pixels: 0, need: NOTHING };
  #last: CountSample | undefined;
  #ratio: Ratio = { pixels: 1, need: { visible: 1, pairs: 1 } };

  /** Samples before the buffers shrink. */
  get looks(): number {
    return this.#looks;
  }

  /** Records that the buffers shrank. */
  shrink(): void {
    this.#hasShrunk = true;
  }

  /** Records that the buffers had to grow. */
  grow(): void {
    if (this.#hasShrunk) this.#looks *= SAMPLES_GROWTH;
    this.#hasShrunk = false;
  }

  /** Records a sample. */
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

  /** Estimated need of the last sampled view at rest; undefined before the first sample. */
  get lastNeed(): Capacity | undefined {
    return this.#last && this.wholeNeedBy(this.#last);
  }

  /** Need of the last frame at rest, if it had this many pixels. */
  wholeNeed(pixels: number): Capacity {
    return pixels === this.#whole.pixels ? this.#whole.need : NOTHING;
  }

  /** Estimated need of the same view at rest: scaled by the ratio measured at the last change between motion and rest. */
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
