import { QUALITIES, type PerFrameSettings } from '@gaussian-splat/renderer';

/** A quality level of frames in motion. */
export interface QualityLevel {
  /** Name of the level in statistics. */
  readonly name: string;
  /**
   * Settings in which frames differ from those at rest; undefined for the first level, which equals the image at rest.
   */
  readonly settings: Partial<PerFrameSettings> | undefined;
  /** Width and height of drawn frames, as a fraction of those of the image. */
  readonly scale: number;
}

/**
 * Width and height of frames at the reduced levels, as fractions of those of the image. Each level has about half the
 * pixels of the one before.
 */
const SCALES = [0.71, 0.5, 0.35, 0.25];

/**
 * Allowed error of levels of detail, in drawn pixels, at full and at lower resolution. It causes hardly any loss in
 * close views. In distant views it causes a smaller loss than fewer pixels would (docs/decisions/0014).
 */
const [BALANCED_DETAIL, SMALLER_DETAIL] = [0.5, 1];

const { depthKeyBits, transmittanceMin } = QUALITIES.balanced;
const balanced: Partial<PerFrameSettings> = { depthKeyBits, transmittanceMin, detail: BALANCED_DETAIL };

/**
 * All levels by decreasing quality: full quality, then the settings of `balanced`, which save the most time for their
 * loss, then fewer pixels. The settings are shared objects, because the renderer compares them by identity.
 * docs/frontier lists the loss in dB and the time of each level.
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

/**
 * Minimum number of pixels of frames at a level. With fewer pixels, each tile has too many splats, and frames take
 * longer.
 */
const MIN_PIXELS = 8192;

/**
 * PSNR of reduced frames in dB, by their scale. Images of hair or of small subjects lose nearly all detail at one half.
 */
export type Losses = ReadonlyMap<number, number>;

/**
 * Minimum PSNR of a level, dB. Below it, over 10 % of the covered pixels would be off by more than 16/255
 * (docs/decisions/0014).
 */
export const MIN_PSNR = 27;

/**
 * Returns the levels that are usable for an image with a number of pixels at full resolution. Scales without a measured
 * loss count as usable.
 */
export const levelsForSize = (
  pixels: number,
  levels: readonly QualityLevel[],
  losses?: Losses,
): readonly QualityLevel[] =>
  levels.filter(
    ({ scale }) => scale === 1 || (scale ** 2 * pixels >= MIN_PIXELS && (losses?.get(scale) ?? Infinity) >= MIN_PSNR),
  );
