/** Chooses the quality level of frames in motion: a pure function of the measured frame times. */
import type { QualityLevel } from './quality-levels.js';
import { quantile } from './display-interval.js';
import { HOLD_MS, INITIAL_QUALITY, type QualityState, type QualityReason } from './start.js';
import { inPixels, modelOf, type TimeModel } from './time-model.js';

/** The measured time of a frame. */
export interface FrameSample {
  /** Time when the measurement arrived, in milliseconds of any monotonic clock. */
  readonly now: number;
  /** Index of the level at which the frame was drawn. */
  readonly level: number;
  readonly milliseconds: number;
}

/** Parameters from which a level is chosen. */
export interface QualityTargets {
  /** Target duration of a frame, ms. */
  readonly targetMs: number;
  /** Levels by decreasing quality; the first one is full quality. */
  readonly levels: readonly QualityLevel[];
}

/** Number of recent frames that are considered. A single slow frame does not change their typical time. */
export const MEMORY = 9;
const ENOUGH = 5;
/** Minimum frame time, ms; shorter times are indistinguishable from 0. */
const NOTHING_MS = 0.01;
/** Number of frames that a step down needs; fewer than the number for a step up. */
const MIN_FRAMES = 3;
/**
 * Fractions of the target: a level is chosen if it is predicted to take at most the first, and kept while frames take
 * at most the second.
 */
export const AIM = 0.85;
const LATE = 1.05;
/**
 * Levels whose time is within this factor of the fastest level count as equally fast; the most accurate of them is
 * chosen.
 */
const AS_FAST = 1.05;
/**
 * Maximum factor by which the smoothed frame time grows per second. Faster growth usually comes from another tab or
 * from the page, not from the scene.
 */
const GROWTH = Math.exp(2.8);
/**
 * Minimum of the smoothed frame time, as a fraction of the target. Without it, the smoothed time would lag behind slow
 * frames for seconds after almost empty ones.
 */
const LITTLE = 0.04;
/** Maximum time between two frames that counts for this growth, ms. */
const LONGEST_STEP_MS = 100;
/**
 * Length of a pause after which the GPU runs at a low clock, ms, and the duration of that state, ms. Frames of this
 * time are not representative.
 */
const REST_MS = 250;
const WAKING_MS = 400;
/** Factor by which the hold grows if the last upward step had to be undone, and the maximum of the hold, ms. */
export const LONGER = 3;
export const LONGEST_HOLD_MS = 60_000;
/** Factor of the target above which frame times end a hold early. */
const FAR_TOO_LATE = 1.25;
/** Time without a change of level after which an unmeasured level is tried, if it may be fast enough, ms. */
const TRIAL_MS = 6_000;

/** Returns the state after the measurement of a frame. Late measurements of frames at another level are ignored. */
export function nextQuality(state: QualityState, sample: FrameSample, rules: QualityTargets): QualityState {
  if (sample.level !== state.level) return state;
  const seen = observe(state, sample, rules);
  return choose(seen, sample.now, rules) ?? seen;
}

/** Returns the state with the time of a frame added to the measurements of its level. */
function observe(
  state: QualityState,
  { now, level, milliseconds }: FrameSample,
  { targetMs }: QualityTargets,
): QualityState {
  const hasRested = now - milliseconds - state.sampledAt > REST_MS;
  const movedAt = hasRested ? now - milliseconds : state.movedAt;
  const recent = [...state.recent, Math.max(NOTHING_MS, milliseconds)].slice(-MEMORY);
  const usual = usualOf(recent);
  const isWaking = hasRested || now - movedAt < WAKING_MS;
  const step = isWaking ? 0 : Math.min(LONGEST_STEP_MS, now - state.sampledAt);
  const max = (state.smoothedMs || AIM * targetMs) * GROWTH ** (step / 1000);
  let { measured } = state;
  const load = state.load || usual;
  // While fewer than `MEMORY` frames are measured at a level, its time is related to the load before the change of
  // level.
  if (state.recent.length < MEMORY && recent.length >= MIN_FRAMES)
    measured = { ...measured, [level]: { share: usual / load, at: now, load } };
  const smoothedMs = recent.length < MIN_FRAMES ? state.smoothedMs : Math.max(LITTLE * targetMs, Math.min(max, usual));
  return { ...state, recent, movedAt, sampledAt: now, load, measured, smoothedMs };
}

/**
 * Returns the typical time of a frame, ms: the mean of the middle half. The times of two queued frames may arrive
 * together, so a median would alternate.
 */
export function usualOf(recent: readonly number[]): number {
  const cut = recent.length >> 2;
  const middle = [...recent].sort((x, y) => x - y).slice(cut, recent.length - cut);
  return middle.reduce((sum, time) => sum + time, 0) / middle.length;
}

/** Returns the state with another level, or null to keep the current level. */
function choose(state: QualityState, now: number, rules: QualityTargets): QualityState | null {
  const { level, recent, measured } = state;
  if (recent.length < MIN_FRAMES) return null;
  const usual = usualOf(recent);
  const load = usual / measured[level].share;
  const model = modelOf(rules.levels, measured, { now, level, load });
  const times = model.shares.map((share) => share * load);
  if (state.smoothedMs > LATE * rules.targetMs) return whereLate(state, now, times, model, rules);
  return level > 0 ? whereInTime(state, now, times, model, rules) : null;
}

/**
 * Returns the most accurate level that is predicted to be fast enough, otherwise the most accurate of the fastest
 * levels.
 */
function bestOf(times: readonly number[], targetMs: number): number {
  const min = Math.min(...times);
  const within = min <= AIM * targetMs ? AIM * targetMs : Math.max(targetMs, AS_FAST * min);
  return times.findIndex((time) => time <= within);
}

function whereLate(
  state: QualityState,
  now: number,
  times: number[],
  { isKnown }: TimeModel,
  rules: QualityTargets,
): QualityState | null {
  const { level, recent, direction, turnedAt } = state;
  const { targetMs } = rules;
  const usual = times[level];
  let to = bestOf(times, targetMs);
  // An unmeasured level is not tried while frames are late. Without a prediction that is clearly faster, only measured
  // levels are considered.
  if (times[to] * AS_FAST > usual)
    to = bestOf(
      times.map((time, other) => (isKnown[other] ? time : Infinity)),
      targetMs,
    );
  if (to === level) return null;
  const isTurn = direction !== (to > level ? 'down' : 'up');
  const isSoon = now - turnedAt < HOLD_MS;
  const isUrgent = to > level && usual > FAR_TOO_LATE * targetMs && times[to] <= targetMs;
  if (isTurn && isSoon && !isUrgent) return null;
  if (to < level && recent.length < ENOUGH) return null;
  return change(state, now, to, 'over-budget', times[to]);
}

/**
 * Returns the state with a more accurate level that is predicted to be fast enough. After {@link TRIAL_MS} without a
 * change, tries the next level if it may be fast enough. Returns null to keep the current level.
 */
function whereInTime(
  state: QualityState,
  now: number,
  times: number[],
  { isKnown }: TimeModel,
  rules: QualityTargets,
): QualityState | null {
  const { level, recent, changedAt, turnedAt, direction, hold } = state;
  const { levels, targetMs } = rules;
  if (recent.length < ENOUGH) return null;
  if (direction === 'down' && now - turnedAt < hold) return null;
  // Returns the maximum time of a level, ms. For an unmeasured level, it is proportional to the pixels.
  const maxOf = (other: number): number =>
    isKnown[other] ? times[other] : (times[level] * inPixels(levels[other], other)) / inPixels(levels[level], level);
  const to = times.findIndex((time, other) => time <= AIM * targetMs && maxOf(other) <= targetMs);
  if (to !== -1 && to < level) return change(state, now, to, 'headroom', times[to]);
  const above = level - 1;
  const mayBe = times[above] <= targetMs && maxOf(above) <= FAR_TOO_LATE * targetMs;
  const isTried = now - changedAt > TRIAL_MS && !isKnown[above] && mayBe;
  return isTried ? change(state, now, above, 'probe', times[above]) : null;
}

function change(
  state: QualityState,
  now: number,
  level: number,
  reason: QualityReason,
  predicted: number,
): QualityState {
  const { recent, measured, changedAt } = state;
  const load = quantile(recent.slice(-ENOUGH), 0.5) / measured[state.level].share;
  const direction = level > state.level ? 'down' : 'up';
  const turns = direction !== state.direction;
  const isOscillation = direction === 'down' && turns && now - changedAt < HOLD_MS;
  return {
    ...state,
    level,
    reason,
    recent: [],
    smoothedMs: predicted,
    changedAt: now,
    turnedAt: turns ? now : state.turnedAt,
    direction,
    hold: direction === 'up' ? state.hold : isOscillation ? Math.min(LONGEST_HOLD_MS, LONGER * state.hold) : HOLD_MS,
    load,
    measured: { ...measured, [state.level]: { ...measured[state.level], at: now, load } },
  };
}

/**
 * Returns the state after the set of usable levels has changed for an image of the same size. Measurements of the
 * remaining levels are kept.
 */
export function limited(state: QualityState, levels: readonly QualityLevel[]): QualityState {
  const last = levels.length - 1;
  return state.level <= last ? state : { ...state, level: last, recent: [], smoothedMs: 0 };
}

/**
 * Returns the state after the number of pixels has changed by the factor `growth`, which invalidates all measurements.
 * The new level draws about as many pixels as the previous one, which takes no longer.
 */
export function resized(state: QualityState, growth: number, levels: readonly QualityLevel[]): QualityState {
  const level = Math.min(state.level, levels.length - 1);
  const pixels = inPixels(levels[level], level);
  const asMany = levels.findIndex((other, number) => growth * inPixels(other, number) <= pixels);
  const { reason, sampledAt, movedAt } = state;
  return { ...INITIAL_QUALITY, level: asMany === -1 ? level : Math.min(level, asMany), reason, sampledAt, movedAt };
}
