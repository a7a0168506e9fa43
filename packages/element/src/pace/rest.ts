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
