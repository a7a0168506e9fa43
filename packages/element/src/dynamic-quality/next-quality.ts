/** How much of the whole image a frame in motion can afford: a pure function of what frames took. */
import type { QualityLevel } from './quality-levels.js';
import { quantile } from './display-interval.js';
import { HOLD_MS, INITIAL_QUALITY, type QualityState, type QualityReason } from './start.js';
import { inPixels, modelOf, type TimeModel } from './time-model.js';

/** What a frame took. */
export interface FrameSample {
  /** When that became known, ms on any clock that runs. */
  readonly now: number;
  /** Level that the frame was drawn with. */
  readonly level: number;
  readonly milliseconds: number;
}

/** What the level is chosen by. */
export interface QualityTargets {
  /** What a frame may take, ms. */
  readonly targetMs: number;
  /** The first is the whole image; the others lose more and more. */
  readonly levels: readonly QualityLevel[];
}

/** Frames of which the usual ones count: a slow one now and then is no reason for anything. */
const MEMORY = 9;
const ENOUGH = 5;
/** What takes less cannot be told from nothing, ms. */
const NOTHING_MS = 0.01;
/** Fewer, where all of them are too slow. */
const LEAST = 3;
/** The level is chosen to take this share of the target; it stays up to the other. */
const AIM = 0.85;
const LATE = 1.05;
/** Levels that take so little longer than the fastest are as good, and more accurate. */
const AS_FAST = 1.05;
/** Frames are believed to take longer by so many times in a second at most: what grows faster is another tab, or the page, more often than the scene. */
const GROWTH = Math.exp(2.8);
/** Belief begins at this share of the target: after frames that took next to nothing, it would follow slow ones for seconds. */
const LITTLE = 0.04;
/** Milliseconds between two frames that count for this. */
const LONGEST_STEP_MS = 100;
/** After such a rest, ms, the clock of an idle GPU is low, for so long: frames say little. */
const REST_MS = 250;
const WAKING_MS = 400;
/** Holds are longer by so many times where the last climb was regretted. */
const LONGER = 3;
const LONGEST_HOLD_MS = 60_000;
/** A fall so late may come sooner. */
const FAR_TOO_LATE = 1.25;
/** After so long without a change, ms, an unknown level is tried that may be in time. */
const TRIAL_MS = 6_000;

/** The pace after a frame. Frames of another level are too late to say anything. */
export function nextQuality(state: QualityState, sample: FrameSample, rules: QualityTargets): QualityState {
  if (sample.level !== state.level) return state;
  const seen = observe(state, sample, rules);
  return choose(seen, sample.now, rules) ?? seen;
}

/** With what a frame says of its level and of the load. */
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
  const most = (state.smoothedMs || AIM * targetMs) * GROWTH ** (step / 1000);
  let { measured } = state;
  const load = state.load || usual;
  // While the memory fills, the load is taken to be that of before the change.
  if (state.recent.length < MEMORY && recent.length >= LEAST)
    measured = { ...measured, [level]: { share: usual / load, at: now, load } };
  const smoothedMs = recent.length < LEAST ? state.smoothedMs : Math.max(LITTLE * targetMs, Math.min(most, usual));
  return { ...state, recent, movedAt, sampledAt: now, load, measured, smoothedMs };
}

/** Usual time of a frame, ms: the mean of the middle half. The answers for two frames that wait for one another may arrive together, so a median would alternate. */
function usualOf(recent: readonly number[]): number {
  const cut = recent.length >> 2;
  const middle = [...recent].sort((x, y) => x - y).slice(cut, recent.length - cut);
  return middle.reduce((sum, time) => sum + time, 0) / middle.length;
}

/** The next level, or null where it stays. */
function choose(state: QualityState, now: number, rules: QualityTargets): QualityState | null {
  const { level, recent, measured } = state;
  if (recent.length < LEAST) return null;
  const usual = usualOf(recent);
  const load = usual / measured[level].share;
  const model = modelOf(rules.levels, measured, { now, level, load });
  const times = model.shares.map((share) => share * load);
  if (state.smoothedMs > LATE * rules.targetMs) return whereLate(state, now, times, model, rules);
  return level > 0 ? whereInTime(state, now, times, model, rules) : null;
}

/** The most accurate level that is predicted in time, else one of the fastest. */
function bestOf(times: readonly number[], targetMs: number): number {
  const least = Math.min(...times);
  const within = least <= AIM * targetMs ? AIM * targetMs : Math.max(targetMs, AS_FAST * least);
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
  // What is not worth a try must be known to be as fast.
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

/** Up, where that is predicted in time; after a while without a change, one level up where that may be. */
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
  // What was never measured may take as much as its pixels say.
  const mostOf = (other: number): number =>
    isKnown[other] ? times[other] : (times[level] * inPixels(levels[other], other)) / inPixels(levels[level], level);
  const to = times.findIndex((time, other) => time <= AIM * targetMs && mostOf(other) <= targetMs);
  if (to !== -1 && to < level) return change(state, now, to, 'spare', times[to]);
  const above = level - 1;
  const mayBe = times[above] <= targetMs && mostOf(above) <= FAR_TOO_LATE * targetMs;
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

/** The pace where other levels serve an image of the same size: what was measured of those that stay counts on. */
export function limited(state: QualityState, levels: readonly QualityLevel[]): QualityState {
  const last = levels.length - 1;
  return state.level <= last ? state : { ...state, level: last, recent: [], smoothedMs: 0 };
}

/**
 * The pace where images have so many times the pixels, and other levels may serve: what was measured says nothing of these. Fewer pixels are drawn with as
 * many of them as before, for they take no longer.
 */
export function resized(state: QualityState, growth: number, levels: readonly QualityLevel[]): QualityState {
  const level = Math.min(state.level, levels.length - 1);
  const pixels = inPixels(levels[level], level);
  const asMany = levels.findIndex((other, number) => growth * inPixels(other, number) <= pixels);
  const { reason, sampledAt, movedAt } = state;
  return { ...INITIAL_QUALITY, level: asMany === -1 ? level : Math.min(level, asMany), reason, sampledAt, movedAt };
}
