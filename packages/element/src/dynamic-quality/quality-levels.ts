import { QUALITIES, type PerFrameSettings } from '@gaussian-splat/renderer';

/** How frames in motion may be drawn. */
export interface QualityLevel {
  /** For people. */
  readonly name: string;
  /** Settings of the frame; undefined on the first level, which equals the image at rest. */
  readonly settings: Partial<PerFrameSettings> | undefined;
  /** Fraction of the image's width and height that is drawn. */
  readonly scale: number;
}

/** Fractions of the image's width and height: each level has about half the pixels of the one before. */
const SCALES = [0.71, 0.5, 0.35, 0.25];

/**
 * Allowed error of levels of detail, in drawn pixels: hardly any loss in close views, and a smaller one in distant
 * views than fewer pixels would cause (docs/decisions/0014).
 */
const [BALANCED_DETAIL, SMALLER_DETAIL] = [0.5, 1];

const { depthKeyBits, transmittanceMin } = QUALITIES.balanced;
const balanced: Partial<PerFrameSettings> = { depthKeyBits, transmittanceMin, detail: BALANCED_DETAIL };

/**
 * All levels from the full image down: the settings of the quality `balanced`, which save the most time per loss, then
 * fewer pixels. The objects are shared, because the renderer compares settings by identity. docs/frontier lists the dB
 * and the time of each.
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

/** Minimum number of pixels of a level: below it, tiles have too many splats each, and frames take longer. */
const MIN_PIXELS = 8192;

/**
 * Error of a frame by the fraction of pixels across and down, dB; hair and small subjects lose nearly everything at one
 * half.
 */
export type Losses = ReadonlyMap<number, number>;

/**
 * Levels below this PSNR are not used: over 10 % of the covered pixels would be off by more than 16/255
 * (docs/decisions/0014).
 */
export const MIN_PSNR = 27;

/** The levels that are usable for an image of this number of pixels and these losses. */
export const levelsForSize = (
  pixels: number,
  levels: readonly QualityLevel[],
  losses?: Losses,
): readonly QualityLevel[] =>
  levels.filter(
    ({ scale }) => scale === 1 || (scale ** 2 * pixels >= MIN_PIXELS && (losses?.get(scale) ?? Infinity) >= MIN_PSNR),
  );
