/** How much of the whole image a frame in motion can afford: a pure function of what frames took. */
import type { QualityLevel } from './quality-levels.js';
import { quantile } from './display-interval.js';
import { HOLD_MS, INITIAL_QUALITY, type QualityState, type QualityReason } from './start.js';
import { inPixels, modelOf, type TimeModel } from './time-model.js';

/** The measured time of a frame. */
export interface FrameSample {
  /** Arrival of the measurement, ms of any monotonic clock. */
  readonly now: number;
  /** Level that the frame was drawn with. */
  readonly level: number;
  readonly milliseconds: number;
}

/** Parameters of the choice of a level. */
export interface QualityTargets {
  /** Time budget of a frame, ms. */
  readonly targetMs: number;
  /** The first is the whole image; the others lose more and more. */
  readonly levels: readonly QualityLevel[];
}

/** Number of recent frames; the typical ones count, so a single slow frame changes nothing. */
const MEMORY = 9;
const ENOUGH = 5;
/** Shorter times are indistinguishable from 0, ms. */
const NOTHING_MS = 0.01;
/** Frames needed for a decision if all of them are too slow. */
const MIN_FRAMES = 3;
/** The level is chosen to take the first fraction of the target; it is kept up to the second. */
const AIM = 0.85;
const LATE = 1.05;
/** Levels that take so little longer than the fastest are as good, and more accurate. */
const AS_FAST = 1.05;
/**
 * Maximum growth per second of the accepted frame time, as a factor: faster growth usually comes from another tab or
 * the page, not from the scene.
 */
const GROWTH = Math.exp(2.8);
/**
 * Minimum of the accepted frame time as a fraction of the target: after almost empty frames it would lag behind slow
 * ones for seconds.
 */
const LITTLE = 0.04;
/** Upper limit of the time between two frames in that growth, ms. */
const LONGEST_STEP_MS = 100;
/**
 * After a pause of this length, ms, an idle GPU runs at a low clock for the second time: frames are not representative.
 */
const REST_MS = 250;
const WAKING_MS = 400;
/** Factor for longer holds if the last upward step had to be undone. */
const LONGER = 3;
const LONGEST_HOLD_MS = 60_000;
/** Frames later than this factor of the target end a hold early. */
const FAR_TOO_LATE = 1.25;
/** After this time without a change, ms, an unmeasured level is tried if it may be fast enough. */
const TRIAL_MS = 6_000;

/** The controller state after a frame. Frames of another level arrive too late and are ignored. */
export function nextQuality(state: QualityState, sample: FrameSample, rules: QualityTargets): QualityState {
  if (sample.level !== state.level) return state;
  const seen = observe(state, sample, rules);
  return choose(seen, sample.now, rules) ?? seen;
}

/** Adds the time of a frame to the measurements of its level and of the load. */
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
  // Until the memory is full, the load from before the change is used.
  if (state.recent.length < MEMORY && recent.length >= MIN_FRAMES)
    measured = { ...measured, [level]: { share: usual / load, at: now, load } };
  const smoothedMs = recent.length < MIN_FRAMES ? state.smoothedMs : Math.max(LITTLE * targetMs, Math.min(max, usual));
  return { ...state, recent, movedAt, sampledAt: now, load, measured, smoothedMs };
}

/**
 * Typical time of a frame, ms: the mean of the middle half. The times of two queued frames may arrive together, so a
 * median would alternate.
 */
function usualOf(recent: readonly number[]): number {
  const cut = recent.length >> 2;
  const middle = [...recent].sort((x, y) => x - y).slice(cut, recent.length - cut);
  return middle.reduce((sum, time) => sum + time, 0) / middle.length;
}

/** The next level, or null to keep the current one. */
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

/** The most accurate level that is predicted to be fast enough, else one of the fastest. */
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
  // An unmeasured level is not tried here: only a level known to be as fast is chosen.
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
  return change(state, now, to, 'slow', times[to]);
}

/**
 * Steps up to a level that is predicted to be fast enough; after a while without a change, one level up if that may be
 * fast enough.
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
  // Upper limit for an unmeasured level: proportional to its pixels.
  const maxOf = (other: number): number =>
    isKnown[other] ? times[other] : (times[level] * inPixels(levels[other], other)) / inPixels(levels[level], level);
  const to = times.findIndex((time, other) => time <= AIM * targetMs && maxOf(other) <= targetMs);
  if (to !== -1 && to < level) return change(state, now, to, 'spare', times[to]);
  const above = level - 1;
  const mayBe = times[above] <= targetMs && maxOf(above) <= FAR_TOO_LATE * targetMs;
  const isTried = now - changedAt > TRIAL_MS && !isKnown[above] && mayBe;
  return isTried ? change(state, now, above, 'trial', times[above]) : null;
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
 * The controller state after the usable levels of an image of the same size change; measurements of the remaining
 * levels are kept.
 */
export function limited(state: QualityState, levels: readonly QualityLevel[]): QualityState {
  const last = levels.length - 1;
  return state.level <= last ? state : { ...state, level: last, recent: [], smoothedMs: 0 };
}

/**
 * The controller state after the number of pixels changes by a factor and other levels become usable: earlier
 * measurements do not apply. The new level draws about as many pixels as before, which takes no longer.
 */
export function resized(state: QualityState, growth: number, levels: readonly QualityLevel[]): QualityState {
  const level = Math.min(state.level, levels.length - 1);
  const pixels = inPixels(levels[level], level);
  const asMany = levels.findIndex((other, number) => growth * inPixels(other, number) <= pixels);
  const { reason, sampledAt, movedAt } = state;
  return { ...INITIAL_QUALITY, level: asMany === -1 ? level : Math.min(level, asMany), reason, sampledAt, movedAt };
}
