/** As much of a wait, ms, as timers can: whatever is longer, `Infinity` too, they take for none at all. */
export const timerMs = (wait: number): number => Math.min(wait, 2 ** 31 - 1);
