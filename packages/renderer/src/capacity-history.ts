/** What pictures have needed: for the rooms of those to come. */

/** For how much the buffers between the stages have room. */
export interface Capacity {
  /** Splats that are visible at once. */
  readonly visible: number;
  /** Pairs of splat and bin of the tiles. */
  readonly pairs: number;
}

/** Looks at buffers with room to spare before they shrink. */
const PATIENCE = 4;
/** So many times as many where they had to grow again: views that come and go, such as an orbit's, soon keep the room that the largest needs. */
const PATIENCE_GROWTH = 4;
/** Two looks within such a time, ms, are at about the same view. */
const SAME_VIEW_MS = 1_000;
/** With the pixels of a picture to such powers its need grows, where it was not seen: of levels of detail more splats, and pairs (0.1 from afar, 0.6 close up). */
const EXPONENTS: Capacity = { visible: 0.25, pairs: 0.5 };
/** By the settings of motion alone, more than the share of pixels says. */
const MOST_OF_MOTION = 2;

const NOTHING: Capacity = { visible: 0, pairs: 0 };

/** Which picture a look was at. */
export interface SampledFrame {
  /** Its pixels. */
  readonly pixels: number;
  /** Those of the picture at rest. */
  readonly wholePixels: number;
  /** It was drawn as at rest. */
  readonly isWhole: boolean;
}

interface CountSample extends SampledFrame {
  readonly used: Capacity;
  readonly at: number;
}

/** How often the room of a picture in motion the picture at rest needs, and of how many times its pixels that was seen. */
interface Ratio {
  readonly pixels: number;
  readonly need: Capacity;
}

/** What the monitors of a scene learn: how long room to spare is kept, and what the picture at rest needs while those in motion show less. */
export class CapacityHistory {
  #looks = PATIENCE;
  #hasShrunk = false;
  #whole = { pixels: 0, need: NOTHING };
  #last: CountSample | undefined;
  #ratio: Ratio = { pixels: 1, need: { visible: 1, pairs: 1 } };

  /** Looks at the buffers before they shrink. */
  get looks(): number {
    return this.#looks;
  }

  /** Room was given up. */
  shrink(): void {
    this.#hasShrunk = true;
  }

  /** There had to be more room. */
  grow(): void {
    if (this.#hasShrunk) this.#looks *= PATIENCE_GROWTH;
    this.#hasShrunk = false;
  }

  /** Takes note of a look. */
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

  /** What the last frame that was looked at needs when it is whole; undefined where none was looked at. */
  get lastNeed(): Capacity | undefined {
    return this.#last && this.wholeNeedBy(this.#last);
  }

  /** What the last whole picture needed, if that had so many pixels. */
  wholeNeed(pixels: number): Capacity {
    return pixels === this.#whole.pixels ? this.#whole.need : NOTHING;
  }

  /** What the whole picture of the same view would need: so many times as much as when pictures last changed from one kind to the other. */
  wholeNeedBy({ pixels, wholePixels, isWhole, used }: Omit<CountSample, 'at'>): Capacity {
    if (isWhole) return used;
    const { pixels: seen, need } = this.#ratio;
    const times = wholePixels / pixels;
    const estimate = (key: keyof Capacity): number => {
      const ratio = need[key] * (times / seen) ** EXPONENTS[key];
      return Math.ceil(used[key] * Math.max(1, Math.min(MOST_OF_MOTION * times, ratio)));
    };
    return { visible: estimate('visible'), pairs: estimate('pairs') };
  }
}
