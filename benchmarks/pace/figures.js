/** From the frames of a step of the load to its figures: pure. */
import { quantile } from '../run/summary.js';

/**
 * Requirements for a step, ms: the time after which frames stay within the budget, with at most one reversal until
 * then.
 */
export const [IN_TIME_AFTER, QUIET_UNTIL] = [1_000, 5_000];

const rounded = (value) => (value === undefined ? null : Number(value.toFixed(3)));

/** How often a row of levels changes its direction. */
export function reversals(levels) {
  const steps = levels
    .slice(1)
    .map((level, i) => Math.sign(level - levels[i]))
    .filter((step) => step !== 0);
  return steps.slice(1).filter((step, i) => step !== steps[i]).length;
}

/** Levels with the time, ms after the step, at which each began. */
export function levelsOf(frames) {
  return frames
    .filter(({ moving }, i) => i === 0 || moving !== frames[i - 1].moving)
    .map(({ at, moving }) => ({ at: Math.round(at), level: moving }));
}

/**
 * Figures of one element.
 * @param frames {{at: number, interval: number, moving: string, target: number, span: number | null}[]} each frame of
 * the display: ms after the step, ms since the previous frame, the level of frames in motion, the frame budget, and the
 * duration of a frame that was measured since
 * @param ladder names of all levels, the accurate frame first
 */
export function figuresOf(frames, levels) {
  const late = frames.filter(({ at }) => at >= IN_TIME_AFTER);
  const early = frames.filter(({ at }) => at < QUIET_UNTIL);
  const shares = late.filter(({ span }) => span !== null).map(({ span, target }) => span / target);
  return {
    target: rounded(frames.at(-1)?.target),
    timed: shares.length,
    /** Ratio to the frame budget. */
    span: { p50: rounded(quantile(shares, 0.5)), p95: rounded(quantile(shares, 0.95)) },
    reversals: reversals(early.map(({ moving }) => levels.indexOf(moving))),
    levels: levelsOf(frames),
  };
}

/** The worst of the elements' figures, and what they share. */
export function summarize(ofElements, frames) {
  const worst = (of) => Math.max(...ofElements.map(of));
  const late = frames.filter(({ at }) => at >= IN_TIME_AFTER).map(({ interval }) => interval);
  return {
    target: ofElements[0].target,
    span: { p50: worst(({ span }) => span.p50 ?? 0), p95: worst(({ span }) => span.p95 ?? 0) },
    timed: Math.min(...ofElements.map(({ timed }) => timed)),
    interval: { p50: rounded(quantile(late, 0.5)), p95: rounded(quantile(late, 0.95)) },
    reversals: worst((figures) => figures.reversals),
    levels: ofElements[0].levels,
  };
}

/** PSNR of two images of 8 bits over the pixels that either covers; `identical`, or `empty` if neither covers any. */
export function decibels(a, b) {
  let [sum, count] = [0, 0];
  for (let i = 0; i < a.length; i += 4) {
    const isCovered = a[i] + a[i + 1] + a[i + 2] + b[i] + b[i + 1] + b[i + 2] > 0;
    if (!isCovered) continue;
    for (let k = i; k < i + 3; k++) sum += (a[k] - b[k]) ** 2;
    count += 3;
  }
  if (count === 0) return 'empty';
  return sum === 0 ? 'identical' : rounded(-10 * Math.log10(sum / count / 255 ** 2));
}

/** Minimum pixels of a frame: in smaller frames all splats are in one or two tiles, which take longer. */
const MIN_PIXELS = 128 ** 2;

/** Number of pixels of a frame that takes a given time, from the times of two sizes (`fixed + perPixel * pixels`). */
export function pixelsFor(milliseconds, [a, b], max) {
  const perPixel = (b.milliseconds - a.milliseconds) / (b.pixels - a.pixels);
  if (!(perPixel > 0)) return max;
  const fixed = b.milliseconds - perPixel * b.pixels;
  return Math.max(MIN_PIXELS, Math.min(max, (milliseconds - fixed) / perPixel));
}
