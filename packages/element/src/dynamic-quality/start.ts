/** The state before any measurement, and the delay of the image at rest after a motion. */
import type { MeasuredLevels } from './time-model.js';

/**
 * Reason for the current level. `initial`: nothing is measured yet. `over-budget`: frames took too long. `headroom`: a
 * more accurate level is predicted to be fast enough. `probe`: a more accurate level is measured.
 */
export type QualityReason = 'initial' | 'over-budget' | 'headroom' | 'probe';

/**
 * The level of frames in motion, and the measurements from which the next level is chosen. Times are in milliseconds.
 */
export interface QualityState {
  readonly level: number;
  readonly reason: QualityReason;
  /** Times of the last frames at this level, oldest first, ms. */
  readonly recent: readonly number[];
  /** Smoothed frame time, ms: it follows the typical time, with limited growth. 0 before the first measurement. */
  readonly smoothedMs: number;
  /** Time of the last measurement, and the time when the motion of that frame started. */
  readonly sampledAt: number;
  readonly movedAt: number;
  /**
   * Time of the last change of level, and time and direction of the last step that reversed the direction: `down` is
   * toward lower quality.
   */
  readonly changedAt: number;
  readonly turnedAt: number;
  readonly direction: 'down' | 'up';
  /** Time after a change of direction during which no other change of direction is allowed, ms. */
  readonly hold: number;
  /**
   * Load that is common to all levels, ms: the frame time before the last change of level, divided by the relative time
   * of that level.
   */
  readonly load: number;
  readonly measured: MeasuredLevels;
}

/** Minimum time between two changes of direction, ms: 5 s plus the latency of measurements. */
export const HOLD_MS = 5_200;

export const INITIAL_QUALITY: QualityState = {
  level: 0,
  reason: 'initial',
  recent: [],
  smoothedMs: 0,
  sampledAt: -Infinity,
  movedAt: -Infinity,
  changedAt: -Infinity,
  turnedAt: -Infinity,
  direction: 'down',
  hold: HOLD_MS,
  load: 0,
  measured: {},
};

/** Time after the last change at which the full-resolution image must be shown, ms. */
const SHOWN_BY_MS = 300;
/** Delay of timers on idle pages, ms. */
const TIMER_MS = 2;
/**
 * Minimum and maximum of the wait for further changes, ms. Changes of a hand never follow faster than the minimum, and
 * those of a slow hand follow within the maximum.
 */
const [MIN_WAIT_MS, LONGEST_WAIT_MS] = [50, 150];

/**
 * Returns the delay after the last change until the full-resolution image starts, ms. The image starts as late as its
 * deadline allows, because a hand that moves on would have to wait for it.
 * @param wholeMs Time of a full-resolution frame, ms; 0 if unknown.
 * @param intervalMs Refresh interval of the display, ms. A change is drawn in the next refresh, and so is a requested
 * frame.
 */
export function waitForRest(wholeMs: number, intervalMs: number): number {
  return Math.max(MIN_WAIT_MS, Math.min(LONGEST_WAIT_MS, SHOWN_BY_MS - wholeMs - 2 * intervalMs - TIMER_MS));
}
