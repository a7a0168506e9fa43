/** What frames on the levels take: `a + b * pixels` on those that are reduced, a time of its own for the whole image, learned from what they took. */
import type { QualityLevel } from './quality-levels.js';

/** What is supposed until it is measured: the share of a reduced frame that fewer pixels leave, and what the whole image takes beyond a reduced one of as many pixels. */
const FIXED = 0.2;
const WHOLE = 1.35;
/** How much of the supposed slope is kept: as if it had been measured by levels that lie apart by the root of this share of the pixels. */
const STIFFNESS = 0.001;
/** How long a measurement counts, ms, and how long where the load has changed by more than a quarter since. */
const KNOWN_MS = 120_000;
const KNOWN_UNDER_OTHER_LOAD_MS = 5_000;
const SAME_LOAD = Math.log(1.25);

/** What a level was measured to take. */
export interface Measured {
  /** As a multiple of the load, which all levels have in common. */
  readonly share: number;
  /** When, ms, and under which load, ms. */
  readonly at: number;
  readonly load: number;
}

/** The levels that were measured, by number. */
export type MeasuredLevels = Readonly<Record<number, Measured>>;

/** What the levels take as multiples of the load, and which of them were measured. */
export interface TimeModel {
  readonly shares: readonly number[];
  readonly isKnown: readonly boolean[];
}

/** What a level takes, as against others, where all of it is in the pixels. */
export const inPixels = ({ scale }: QualityLevel, level: number): number => (level === 0 ? WHOLE : scale ** 2);

const supposed = (pixels: number): number => FIXED + (1 - FIXED) * pixels;

/** What is known of a moment. */
export interface Moment {
  readonly now: number;
  /** The level that is drawn with, which was measured, and the load under which it takes what it does, ms. */
  readonly level: number;
  readonly load: number;
}

/** The model of a moment, which says what still counts of what was measured. */
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

/** The line of least squares, stiff where the points do not say how steep it is. */
function lineThrough(points: readonly { x: number; y: number }[], whole?: number): (pixels: number) => number {
  if (points.length === 0) return (pixels) => ((whole ?? 1) / WHOLE) * supposed(pixels);
  const mean = (of: (point: { x: number; y: number }) => number): number =>
    points.reduce((sum, point) => sum + of(point), 0) / points.length;
  const [x, y] = [mean((point) => point.x), mean((point) => point.y)];
  const slope = (y * (1 - FIXED)) / supposed(x);
  const covariance = points.length * mean((point) => (point.x - x) * (point.y - y));
  const variance = points.length * mean((point) => (point.x - x) ** 2);
  const b = (covariance + STIFFNESS * slope) / (variance + STIFFNESS);
  // Fewer pixels win no more than in proportion; more of them, where that is so at all, no more than the whole image lets hope.
  const least = Math.min(0, ((whole === undefined ? y / 2 : whole / WHOLE) - y) / Math.max(1 - x, STIFFNESS));
  const held = Math.max(least, Math.min(b, y / x));
  return (pixels) => y + held * (pixels - x);
}
