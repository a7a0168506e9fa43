/** Controller state before any measurement, and after a motion ends. */
import type { MeasuredLevels } from './time-model.js';

/**
 * Reason for the current level: `start`, nothing is measured yet; `slow`, frames took too long; `spare`, there was time
 * to spare; `trial`, to measure a more accurate level.
 */
export type QualityReason = 'start' | 'slow' | 'spare' | 'trial';

/** The level of frames in motion, and the state kept for the next one. */
export interface QualityState {
  readonly level: number;
  readonly reason: QualityReason;
  /** Times of the last frames on this level, oldest first, ms. */
  readonly recent: readonly number[];
  /** Accepted frame time, ms: follows the typical time, with limited growth. 0 before the first frame. */
  readonly smoothedMs: number;
  /** Time of the last measurement, and start time of its motion. */
  readonly sampledAt: number;
  readonly movedAt: number;
  /** Time of the last change of level, time of the last change of direction, and the current direction. */
  readonly changedAt: number;
  readonly turnedAt: number;
  readonly direction: 'down' | 'up';
  /** How long a change of direction blocks the next one, ms. */
  readonly hold: number;
  /** Load common to all levels, ms: frame times before the last change divided by the relative time of their level. */
  readonly load: number;
  readonly measured: MeasuredLevels;
}

/** Minimum time between two changes of direction, ms: five seconds plus the latency of measurements. */
export const HOLD_MS = 5_200;

export const INITIAL_QUALITY: QualityState = {
  level: 0,
  reason: 'start',
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

/** The full-resolution image is due this long after the last change, ms. */
const SHOWN_BY_MS = 300;
/** Delay of timers, even on idle pages, ms. */
const TIMER_MS = 2;
/**
 * Bounds of the wait for further changes, ms: changes of a slow hand come within the second, and never faster than the
 * first.
 */
const [MIN_WAIT_MS, LONGEST_WAIT_MS] = [50, 150];

/**
 * Delay after the last change until the full-resolution image starts, ms: as late as still meets its deadline, because
 * a hand that continues meanwhile would have to wait for the image.
 * @param wholeMs time of a full-resolution frame, 0 if unknown
 * @param intervalMs refresh interval of the display: a change is drawn in the next refresh, and so is a requested frame
 */
export function waitForRest(wholeMs: number, intervalMs: number): number {
  return Math.max(MIN_WAIT_MS, Math.min(LONGEST_WAIT_MS, SHOWN_BY_MS - wholeMs - 2 * intervalMs - TIMER_MS));
}
