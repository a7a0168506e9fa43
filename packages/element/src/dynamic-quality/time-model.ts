/**
 * Learned model of the frame time per level: `a + b * pixels` for reduced levels, and a separate time for the full
 * image.
 */
import type { QualityLevel } from './quality-levels.js';

/**
 * Prior until measured: the fixed part of a reduced frame, and the factor of the full image over a reduced one of equal
 * pixels.
 */
const FIXED = 0.2;
const WHOLE = 1.35;
/**
 * Weight of the prior slope: equivalent to measurements of levels whose pixel fractions differ by the square root of
 * this value.
 */
const STIFFNESS = 0.001;
/** Lifetime of a measurement, ms, and after the load has changed by more than a quarter. */
const KNOWN_MS = 120_000;
const KNOWN_UNDER_OTHER_LOAD_MS = 5_000;
const SAME_LOAD = Math.log(1.25);

/** A measurement of a level. */
export interface Measured {
  /** As a multiple of the load that is common to all levels. */
  readonly share: number;
  /** Time of the measurement, ms, and the load then, ms. */
  readonly at: number;
  readonly load: number;
}

/** Measurements by number of the level. */
export type MeasuredLevels = Readonly<Record<number, Measured>>;

/** Predicted times of the levels as multiples of the load, and which levels were measured. */
export interface TimeModel {
  readonly shares: readonly number[];
  readonly isKnown: readonly boolean[];
}

/** Relative time of a level if it is proportional to pixels. */
export const inPixels = ({ scale }: QualityLevel, level: number): number => (level === 0 ? WHOLE : scale ** 2);

const supposed = (pixels: number): number => FIXED + (1 - FIXED) * pixels;

/** The state of the measurements at one time. */
export interface Moment {
  readonly now: number;
  /** The current level, which was measured, and the load, ms. */
  readonly level: number;
  readonly load: number;
}

/** The model at one time, from the measurements that are still valid. */
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

/** Least-squares line with a prior for a slope that the points do not determine. */
function lineThrough(points: readonly { x: number; y: number }[], whole?: number): (pixels: number) => number {
  if (points.length === 0) return (pixels) => ((whole ?? 1) / WHOLE) * supposed(pixels);
  const mean = (of: (point: { x: number; y: number }) => number): number =>
    points.reduce((sum, point) => sum + of(point), 0) / points.length;
  const [x, y] = [mean((point) => point.x), mean((point) => point.y)];
  const slope = (y * (1 - FIXED)) / supposed(x);
  const covariance = points.length * mean((point) => (point.x - x) * (point.y - y));
  const variance = points.length * mean((point) => (point.x - x) ** 2);
  const b = (covariance + STIFFNESS * slope) / (variance + STIFFNESS);
  // Fewer pixels save time at most in proportion; more pixels cost at most the prior ratio to the full image.
  const min = Math.min(0, ((whole === undefined ? y / 2 : whole / WHOLE) - y) / Math.max(1 - x, STIFFNESS));
  const held = Math.max(min, Math.min(b, y / x));
  return (pixels) => y + held * (pixels - x);
}
