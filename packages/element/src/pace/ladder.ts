import { QUALITIES, type FrameLevers, type Levers } from '@gaussian-splat/renderer';

/** One step down from the true image, for pictures in motion. */
export interface Rung {
  /** What frames are drawn with; undefined on the first rung, where nothing differs. */
  readonly levers: Partial<FrameLevers> | undefined;
  /** Most that a frame can cost, as a share of the first rung: what scales with pixels, all of it. */
  readonly cost: number;
  /** For people. */
  readonly name: string;
}

/** Shares of the picture's width and height, each with about 0.7 of the pixels of the one before. */
const SCALES = [0.84, 0.71, 0.59, 0.5, 0.42, 0.35, 0.25];
/**
 * Costs of the levers that leave the pixels alone: less than was measured anywhere (0.81 and 0.75 on an H200, with kept orders; docs/decisions/0014), so that a climb is never dearer
 * than it is thought to be. They are only where the search begins: what frames really take decides.
 */
const BALANCED_COST = 0.73;
const FAST_COST = 0.72;

/**
 * The levers of a quality that every frame gains by. An order that is kept spares most frames a sort, but those that make it anew take the longest, and a picture is in time if
 * those are (docs/decisions/0014).
 */
function frameLeversOf({ depthKeyBits, transmittanceMin, alphaMin, visibleSets }: Levers): Partial<FrameLevers> {
  return { depthKeyBits, transmittanceMin, alphaMin, visibleSets };
}

/**
 * Pixels, of those that are drawn, by which rungs may be off where there are levels of detail: next to nothing close up, and from afar less than fewer
 * pixels would cost (docs/decisions/0014).
 */
const BALANCED_DETAIL = 0.5;
const FAST_DETAIL = 1;

const balanced = { ...frameLeversOf(QUALITIES.balanced), detail: BALANCED_DETAIL };
const fast = { ...frameLeversOf(QUALITIES.fast), detail: FAST_DETAIL };

/**
 * All steps, from the true image down: by what is lost, in dB, for each millisecond won. First the levers of the qualities `balanced` and `fast`, which
 * cost least, then pixels. Single objects, since the renderer knows levers by them.
 */
export const LADDER: readonly Rung[] = [
  { name: 'whole', levers: undefined, cost: 1 },
  { name: 'balanced', levers: balanced, cost: BALANCED_COST },
  { name: 'fast', levers: fast, cost: FAST_COST },
  ...SCALES.map((resolutionScale) => ({
    name: `fast at ${resolutionScale}`,
    levers: { ...fast, resolutionScale },
    cost: FAST_COST * resolutionScale ** 2,
  })),
];

/** Fewest pixels that a rung leaves: the parts of a smaller picture have so many splats each that it takes the longer. */
const LEAST_PIXELS = 8192;

/** How many rungs serve a picture of so many pixels: the first ones. */
export function rungsFor(pixels: number): number {
  return LADDER.filter(({ levers }) => {
    const scale = levers?.resolutionScale;
    return scale === undefined || scale ** 2 * pixels >= LEAST_PIXELS;
  }).length;
}
