import { QUALITIES, type PerFrameSettings } from '@gaussian-splat/renderer';

/** How frames in motion may be drawn. */
export interface QualityLevel {
  /** For people. */
  readonly name: string;
  /** What frames are drawn with; undefined on the first level, where nothing differs from the image at rest. */
  readonly settings: Partial<PerFrameSettings> | undefined;
  /** Share of the image's width and height that is drawn. */
  readonly scale: number;
}

/** Shares of the image's width and height: each level has about half the pixels of the one before. */
const SCALES = [0.71, 0.5, 0.35, 0.25];

/**
 * Pixels, of those that are drawn, by which levels may be off where there are levels of detail: next to nothing close up, and from afar less than fewer
 * pixels would cost (docs/decisions/0014).
 */
const [BALANCED_DETAIL, SMALLER_DETAIL] = [0.5, 1];

const { depthKeyBits, transmittanceMin } = QUALITIES.balanced;
const balanced: Partial<PerFrameSettings> = { depthKeyBits, transmittanceMin, detail: BALANCED_DETAIL };

/**
 * All levels, from the whole image down: the settings of the quality `balanced`, which lose least for what they win, then fewer pixels. Single objects, since
 * the renderer knows settings by them. docs/frontier has the dB and the time of each.
 */
export const QUALITY_LEVELS: readonly QualityLevel[] = [
  { name: 'whole', settings: undefined, scale: 1 },
  { name: 'balanced', settings: balanced, scale: 1 },
  ...SCALES.map((scale) => ({
    name: `balanced at ${scale}`,
    settings: { ...balanced, detail: SMALLER_DETAIL, resolutionScale: scale },
    scale,
  })),
];

/** Fewest pixels that a level leaves: the parts of a smaller image have so many splats each that it takes the longer. */
const LEAST_PIXELS = 8192;

/** What shares of a picture's pixels across and down lose of it, dB; of hair and of small subjects half of them lose nearly all. */
export type Losses = ReadonlyMap<number, number>;

/** Levels whose pictures are less like the true one are none: over 10 % of what is covered would be off by more than 16/255 (docs/decisions/0014). */
export const LEAST_DECIBELS = 27;

/** Those of the levels that serve an image of so many pixels, of which fewer pixels lose so much. */
export const levelsForSize = (
  pixels: number,
  levels: readonly QualityLevel[],
  losses?: Losses,
): readonly QualityLevel[] =>
  levels.filter(
    ({ scale }) =>
      scale === 1 || (scale ** 2 * pixels >= LEAST_PIXELS && (losses?.get(scale) ?? Infinity) >= LEAST_DECIBELS),
  );
