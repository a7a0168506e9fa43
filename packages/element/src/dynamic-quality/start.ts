/** The pace before anything is known, and when a motion is over. */
import type { MeasuredLevels } from './time-model.js';

/** Why the level is what it is: `start`, nothing is known yet; `slow`, frames took too long; `spare`, there was time to spare; `trial`, to find out what a more accurate level takes. */
export type QualityReason = 'start' | 'slow' | 'spare' | 'trial';

/** The level of frames in motion, and what is remembered for the next one. */
export interface QualityState {
  readonly level: number;
  readonly reason: QualityReason;
  /** Times of the last frames on this level, oldest first, ms. */
  readonly recent: readonly number[];
  /** What frames are believed to take, ms: what they usually do, which it follows up only so fast. 0 before the first frame. */
  readonly smoothedMs: number;
  /** When the last frame was known, and when the motion began that it belongs to. */
  readonly sampledAt: number;
  readonly movedAt: number;
  /** When the level last changed, when its direction did, and which it is. */
  readonly changedAt: number;
  readonly turnedAt: number;
  readonly direction: 'down' | 'up';
  /** How long a change of direction keeps the next one off, ms. */
  readonly hold: number;
  /** What all levels have in common, ms: what frames took before the last change by the share of their level. */
  readonly load: number;
  readonly measured: MeasuredLevels;
}

/** Between two changes of direction, ms: five seconds and what times may be late. */
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

/** The true image is to be on show so long after the last change, ms. */
const SHOWN_BY_MS = 300;
/** Timers come so much late even on idle pages, ms. */
const TIMER_MS = 2;
/** Bounds on how long it is waited whether more changes come: those of a hand that moves slowly come within the latter, and none sooner than the former. */
const [LEAST_WAIT_MS, LONGEST_WAIT_MS] = [50, 150];

/**
 * How long after the last change the true image is begun, ms: as late as it can be and still be there in time, since a hand that goes on meanwhile would
 * have to wait for it.
 * @param wholeMs what the true image takes, 0 where that is not known
 * @param intervalMs between two pictures of the display: a change is drawn with the next, and so is a frame that is asked for
 */
export function waitForRest(wholeMs: number, intervalMs: number): number {
  return Math.max(LEAST_WAIT_MS, Math.min(LONGEST_WAIT_MS, SHOWN_BY_MS - wholeMs - 2 * intervalMs - TIMER_MS));
}
