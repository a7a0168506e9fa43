/**
 * Model of the frame time at each level, fitted to measurements: `a + b * pixels` for reduced levels, and a separate
 * time for full quality.
 */
import type { QualityLevel } from './quality-levels.js';

/**
 * Assumptions before measurements: the fixed fraction of the time of a reduced frame, and the ratio of full quality to
 * a reduced level with equal pixels.
 */
const FIXED = 0.2;
const WHOLE = 1.35;
/**
 * Weight of the assumed slope. It equals that of measurements whose fractions of pixels differ by the square root of
 * this value.
 */
const STIFFNESS = 0.001;
/** Lifetime of a measurement, ms, and its lifetime if the load has changed by more than a quarter. */
const KNOWN_MS = 120_000;
const KNOWN_UNDER_OTHER_LOAD_MS = 5_000;
const SAME_LOAD = Math.log(1.25);

/** The measured frame time of a level. */
export interface Measured {
  /** Frame time as a multiple of the load that is common to all levels. */
  readonly share: number;
  /** Time of the measurement, and the load at that time, both in ms. */
  readonly at: number;
  readonly load: number;
}

/** Measurements by the index of their level. */
export type MeasuredLevels = Readonly<Record<number, Measured>>;

/** Predicted frame times of the levels, as multiples of the load, and whether each level has a valid measurement. */
export interface TimeModel {
  readonly shares: readonly number[];
  readonly isKnown: readonly boolean[];
}

/**
 * Returns the assumed time of a level, as a multiple of that of a reduced frame with all pixels: its fraction of the
 * pixels, or {@link WHOLE} for full quality (level 0).
 */
export const inPixels = ({ scale }: QualityLevel, level: number): number => (level === 0 ? WHOLE : scale ** 2);

const supposed = (pixels: number): number => FIXED + (1 - FIXED) * pixels;

/** A time for which frame times are predicted, ms, and the current level and load. */
export interface Moment {
  readonly now: number;
  /** Index of the current level, whose measurement is valid, and the current load in ms. */
  readonly level: number;
  readonly load: number;
}

/** Returns the model at one time, from the measurements that are still valid. */
export function modelOf(
  levels: readonly QualityLevel[],
  measured: MeasuredLevels,
  { now, level, load }: Moment,
): TimeModel {
  const isKnown = levels.map((_, other) => {
    const found = measured[other] as Measured | undefined;
    if (found === undefined || other === level) return other === level;
    const isSame = Math.abs(Math.log(load / found.load)) < SAME_LOAD;
    return now - found.at < (isSame ? KNOWN_MS : KNOWN_UNDER_OTHER_LOAD_MS);
  });
  const pixels = levels.map(({ scale }) => scale ** 2);
  const points = levels.flatMap((_, level) =>
    level > 0 && isKnown[level] ? [{ x: pixels[level], y: measured[level].share }] : [],
  );
  const line = lineThrough(points, isKnown[0] ? measured[0].share : undefined);
  const shares = levels.map((_, level) => {
    if (isKnown[level]) return measured[level].share;
    return level === 0 ? WHOLE * line(1) : line(pixels[level]);
  });
  return { shares, isKnown };
}

/**
 * Returns a function from the fraction of pixels to the relative time: a least-squares line, with an assumed slope if
 * the points do not determine it. `whole` is the measured relative time of full quality.
 */
function lineThrough(points: readonly { x: number; y: number }[], whole?: number): (pixels: number) => number {
  if (points.length === 0) return (pixels) => ((whole ?? 1) / WHOLE) * supposed(pixels);
  const mean = (of: (point: { x: number; y: number }) => number): number =>
    points.reduce((sum, point) => sum + of(point), 0) / points.length;
  const [x, y] = [mean((point) => point.x), mean((point) => point.y)];
  const slope = (y * (1 - FIXED)) / supposed(x);
  const covariance = points.length * mean((point) => (point.x - x) * (point.y - y));
  const variance = points.length * mean((point) => (point.x - x) ** 2);
  const b = (covariance + STIFFNESS * slope) / (variance + STIFFNESS);
  // Fewer pixels save time at most in proportion. At all pixels, the line is at least the measured time of full quality
  // divided by the assumed ratio, or half of the mean time if that is unknown.
  const min = Math.min(0, ((whole === undefined ? y / 2 : whole / WHOLE) - y) / Math.max(1 - x, STIFFNESS));
  const held = Math.max(min, Math.min(b, y / x));
  return (pixels) => y + held * (pixels - x);
}
