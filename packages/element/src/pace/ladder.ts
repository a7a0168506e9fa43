import { QUALITIES, type FrameLevers, type Levers } from '@gaussian-splat/renderer';

/** How frames in motion may be drawn. */
export interface Level {
  /** For people. */
  readonly name: string;
  /** What frames are drawn with; undefined on the first level, where nothing differs from the image at rest. */
  readonly levers: Partial<FrameLevers> | undefined;
  /** Share of the image's width and height that is drawn. */
  readonly scale: number;
}

/** Shares of the picture's width and height, each with about 0.7 of the pixels of the one before. */
const SCALES = [0.84, 0.71, 0.59, 0.5, 0.42, 0.35, 0.25];
/**
 * The levers of a quality that every frame gains by. An order that is kept spares most frames a sort, but those that make it anew take the longest, and a picture is in time if
 * those are (docs/decisions/0014).
 */
function frameLeversOf({ depthKeyBits, transmittanceMin, alphaMin, visibleSets }: Levers): Partial<FrameLevers> {
  return { depthKeyBits, transmittanceMin, alphaMin, visibleSets };
}

/**
 * Pixels, of those that are drawn, by which levels may be off where there are levels of detail: next to nothing close up, and from afar less than fewer
 * pixels would cost (docs/decisions/0014).
 */
const BALANCED_DETAIL = 0.5;
const FAST_DETAIL = 1;

const balanced = { ...frameLeversOf(QUALITIES.balanced), detail: BALANCED_DETAIL };
const fast = { ...frameLeversOf(QUALITIES.fast), detail: FAST_DETAIL };

/**
 * All levels, from the whole image down: by what is lost, in dB, for each millisecond won. First the levers of the qualities `balanced` and `fast`, which
 * cost least, then pixels. Single objects, since the renderer knows levers by them.
 */
export const LADDER: readonly Level[] = [
  { name: 'whole', levers: undefined, scale: 1 },
  { name: 'balanced', levers: balanced, scale: 1 },
  { name: 'fast', levers: fast, scale: 1 },
  ...SCALES.map((scale) => ({ name: `fast at ${scale}`, levers: { ...fast, resolutionScale: scale }, scale })),
];

/** Fewest pixels that a level leaves: the parts of a smaller image have so many splats each that it takes the longer. */
const LEAST_PIXELS = 8192;

/** Those of the levels that serve an image of so many pixels. */
export const levelsFor = (pixels: number, levels: readonly Level[]): readonly Level[] =>
  levels.filter(({ scale }) => scale === 1 || scale ** 2 * pixels >= LEAST_PIXELS);
