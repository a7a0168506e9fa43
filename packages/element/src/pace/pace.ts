/** How much of the true image a moving picture can afford: a pure function of what frames took. */
import {
  AS_FAST,
  fastestKnown,
  firstFarBelow,
  firstInTime,
  isAnyKnownAbove,
  isBelieved,
  predict,
  type Knowledge,
  type MeasuredRungs,
} from './rungs.js';

/** What a frame took. */
export interface FrameSample {
  /** When that became known, ms on any clock that runs. */
  readonly now: number;
  /** Rung of the ladder that the frame was drawn on. */
  readonly level: number;
  /** How long it kept the GPU. */
  readonly milliseconds: number;
}

/** What the pace is set by. */
export interface PaceRules {
  /** What a frame may take, ms. */
  readonly targetMs: number;
  /** For each rung, the first being the true image, the most that a frame on it can cost, as a share of the first. Falling. */
  readonly costs: readonly number[];
}

/** Where the pace is, and what is remembered for the next step. */
export interface Pace {
  readonly level: number;
  /** Why the level is what it is. */
  readonly reason: PaceReason;
  /** Times of the last frames on this level, oldest first. */
  readonly recent: readonly number[];
  /** When the last frame was known, and the first after the last rest. */
  readonly sampledAt: number;
  readonly wokeAt: number;
  /** When the level last changed, and when its direction did. */
  readonly changedAt: number;
  readonly turnedAt: number;
  /** When that last came sooner after another one than it should. */
  readonly hurriedAt: number;
  /** The last change was towards the true image. */
  readonly climbed: boolean;
  /** What the rungs were measured to take. */
  readonly measured: MeasuredRungs;
  /** What frames took before the last change by the share of their rung, ms; 0 before the first. */
  readonly load: number;
  /** The highest load of late, and when. */
  readonly peak: { readonly load: number; readonly at: number };
  /** How long a peak of the load is remembered, ms. */
  readonly patience: number;
}

/** `start`: nothing is known yet; `slow`: frames took too long; `spare`: there was time to spare; `trial`: more of the picture takes no longer, or it may be so. */
export type PaceReason = 'start' | 'slow' | 'spare' | 'trial';

/** Frames that are remembered, and the share of them that counts: a slow frame now and then is nobody's fault. */
const MEMORY = 20;
const COUNTED = 0.8;
/** Frames are too slow from this share of the target on, and time to spare begins under the other: the dead band lies between. */
const TOO_SLOW = 1.05;
const TO_SPARE = 0.87;
/** Two or three frames in a row suffice where all are as slow as this. */
const TWO_FRAMES_SLOW = 4;
const THREE_FRAMES_SLOW = 1.25;
/** Frames that are looked at before a small excess counts, and before a climb; a rung is measured by as many. */
const ENOUGH_FRAMES = 12;
/** Frames that tell the load where it may just have changed. */
const LAST_FRAMES = 5;
/** Between a change and a climb, ms. */
const HOLD_MS = 500;
/** After so long without a change, ms, a rung up is tried that may be in time without sparing any; at once where the last climb has cost nothing. */
const TRIAL_MS = 6_000;
/** More of the picture that makes frames so much shorter is a reason to try still more. */
const FASTER = 1.04;
/** Where no rung is fast enough, less of the picture has to bring frames to such a share. */
const WORTHWHILE = 0.95;
/** Less of a picture that makes frames so much longer is taken back after three of them, and sooner than quiet allows where they are as long as the second. */
const HARMFUL = 1.25;
const MUCH_DEARER = 1.6;
/** Between two changes of direction, ms, five seconds and what times may be late: a level that goes to and fro is seen. Only a fall to what is in time, or much faster, comes sooner. */
const QUIET_MS = 5_200;
/** How long the highest load is remembered, ms, which a climb must bear: longer each time that a climb is regretted, so that a load which comes and goes is kept to at its highest. */
const PATIENCE_MS = 2_000;
const LONGER_PATIENCE = 3;
const LONGEST_PATIENCE_MS = 60_000;
/** After such a rest, ms, the first frames say little: the clock of an idle GPU is low. */
const REST_MS = 250;
const WAKING_MS = 120;
/** Since the last frame of a motion, ms, at most: the picture at rest shows the same. */
const AT_REST_MS = 500;

/** Before the first frame. */
export const INITIAL_PACE: Pace = {
  level: 0,
  reason: 'start',
  recent: [],
  sampledAt: -Infinity,
  wokeAt: -Infinity,
  changedAt: -Infinity,
  turnedAt: -Infinity,
  hurriedAt: -Infinity,
  climbed: false,
  measured: {},
  load: 0,
  peak: { load: 0, at: -Infinity },
  patience: PATIENCE_MS,
};

/** The pace after a frame. Frames of another level than the current one are too late to say anything, but for the true image at rest. */
export function keepPace(pace: Pace, sample: FrameSample, rules: PaceRules): Pace {
  const { now, level, milliseconds } = sample;
  if (level !== pace.level) return level === 0 ? learnAtRest(pace, sample, rules) : pace;
  const hasRested = now - pace.sampledAt - milliseconds > REST_MS;
  const wokeAt = hasRested ? now - milliseconds : pace.wokeAt;
  const seen = { ...pace, sampledAt: now, wokeAt };
  if (now - wokeAt < WAKING_MS && milliseconds <= TWO_FRAMES_SLOW * rules.targetMs) return seen;
  const next = learn({ ...seen, recent: [...pace.recent, milliseconds].slice(-MEMORY) }, now);
  const late = lateFrames(next.recent, rules.targetMs);
  const changed =
    takeBack(next, now, rules) ?? (late === null ? climb(next, now, rules) : hurry(next, now, late, rules));
  return changed ?? next;
}

/** With what the last frame says of its rung, and of the load. */
function learn(pace: Pace, now: number): Pace {
  const { level, recent, patience } = pace;
  let { measured, peak } = pace;
  if (recent.length <= ENOUGH_FRAMES) {
    const median = quantile(recent, 0.5);
    const share = pace.load > 0 ? median / pace.load : (measured[level]?.share ?? 1);
    // A single frame tells less than what is known.
    if (recent.length > 1 || !measured[level])
      measured = { ...measured, [level]: { share, at: now, load: median / share } };
  }
  if (recent.length >= ENOUGH_FRAMES) {
    const load = quantile(recent, COUNTED) / measured[level].share;
    if (load >= peak.load || now - peak.at > patience) peak = { load, at: now };
  }
  return { ...pace, measured, peak };
}

/**
 * With what the true image took at rest, right after a motion, where that is not known of motion: the element may have changed its size. Other work may make
 * frames in motion longer, so that what was measured in motion counts for more.
 */
function learnAtRest(pace: Pace, { now, milliseconds }: FrameSample, rules: PaceRules): Pace {
  const { level, recent, measured, sampledAt } = pace;
  if (recent.length < 3 || now - sampledAt > AT_REST_MS + milliseconds) return pace;
  const usual = quantile(recent, 0.5);
  if (isBelieved(0, knowledge(pace, usual, now, rules))) return pace;
  const load = usual / measured[level].share;
  return { ...pace, measured: { ...measured, 0: { share: milliseconds / load, at: now, load } } };
}

/** Frames that take too long. */
interface LateFrames {
  /** What they usually take, ms. */
  readonly usual: number;
  /** The last of them: earlier ones may be of a lower load. */
  readonly last: readonly number[];
}

/** Whether the last frames take too long; null where they do not. */
function lateFrames(recent: readonly number[], targetMs: number): LateFrames | null {
  const [two, three] = [recent.slice(-2), recent.slice(-3)];
  // Later, two in a row are a hiccup.
  const isNew = recent.length < ENOUGH_FRAMES;
  if (isNew && two.length === 2 && Math.min(...two) > TWO_FRAMES_SLOW * targetMs) {
    return { usual: Math.min(...two), last: two };
  }
  if (three.length === 3 && Math.min(...three) > THREE_FRAMES_SLOW * targetMs) {
    // Two of them may be hiccups.
    return { usual: Math.min(quantile(three, 0.5), HARMFUL * Math.min(...three)), last: three };
  }
  const usual = recent.length >= ENOUGH_FRAMES ? quantile(recent, COUNTED) : 0;
  return usual > TOO_SLOW * targetMs ? { usual, last: recent.slice(-LAST_FRAMES) } : null;
}

const isTooSoon = ({ turnedAt }: Pace, now: number): boolean => now - turnedAt < QUIET_MS;

/** One change of direction in five seconds may come too soon. */
const mayHurry = ({ hurriedAt }: Pace, now: number): boolean => now - hurriedAt >= QUIET_MS;

function knowledge({ measured, level }: Pace, milliseconds: number, now: number, { costs }: PaceRules): Knowledge {
  return { measured, level, milliseconds, now, costs };
}

/** From less of the picture that takes longer, to the truest of the rungs above that were fastest. */
function takeBack(pace: Pace, now: number, rules: PaceRules): Pace | null {
  const three = pace.recent.slice(-3);
  if (pace.climbed || three.length < 3) return null;
  const known = knowledge(pace, quantile(three, 0.5), now, rules);
  const to = fastestKnown(known);
  const harm = Math.min(...three) / predict(to, known);
  if (to >= pace.level || harm < HARMFUL || (isTooSoon(pace, now) && !(harm >= MUCH_DEARER && mayHurry(pace, now))))
    return null;
  return change(pace, now, to, 'trial', three);
}

/** Where frames are late: down to the first rung that is in time, else to the truest of the fastest, up or down. */
function hurry(pace: Pace, now: number, { usual, last }: LateFrames, rules: PaceRules): Pace | null {
  const { level, recent } = pace;
  const known = knowledge(pace, usual, now, rules);
  const times = rules.costs.map((_, rung) => (rung > level ? predict(rung, known) : Infinity));
  const inTime = firstInTime(times, known, rules.targetMs);
  const isSoon = pace.climbed && isTooSoon(pace, now);
  if (isSoon && !mayHurry(pace, now)) return null;
  const isSure = inTime !== -1 && isBelieved(inTime, known);
  const hasGrown = usual > HARMFUL * pace.load * pace.measured[level].share;
  if (inTime !== -1 && (!isSoon || isSure || hasGrown)) {
    return change(pace, now, inTime, 'slow', last);
  }
  const best = Math.min(...times);
  if (best < WORTHWHILE * usual) {
    const truest = times.findIndex((time) => time <= AS_FAST * best);
    return isSoon && best * MUCH_DEARER > usual ? null : change(pace, now, truest, 'slow', last);
  }
  if (recent.length < ENOUGH_FRAMES || (!pace.climbed && isTooSoon(pace, now))) return null;
  const deeper = firstFarBelow(known);
  if (deeper !== -1 && !isSoon) return { ...change(pace, now, deeper, 'slow', last), hurriedAt: now };
  const to = fastestKnown(known);
  if (to < level) return change(pace, now, to, 'trial', last);
  // Where nothing is left to fall to, at once.
  const isDue = level === rules.costs.length - 1 || now - pace.changedAt >= TRIAL_MS;
  const isTried = level > 0 && isDue && !isAnyKnownAbove(known);
  return isTried || isFasterAbove(pace) ? change(pace, now, level - 1, 'trial', last) : null;
}

/** The last climb has made frames faster, and what is above was last measured before it. */
function isFasterAbove({ level, measured, climbed, changedAt }: Pace): boolean {
  const [above, here, below] = [measured[level - 1], measured[level], measured[level + 1]];
  if (level === 0 || !climbed || below === undefined || (above !== undefined && above.at > below.at)) return false;
  return below.at >= changedAt && here.share * FASTER <= below.share;
}

/** One rung up, after a hold, if its frames are in time, also under the loads of late. */
function climb(pace: Pace, now: number, rules: PaceRules): Pace | null {
  const { level, recent, changedAt, measured, peak, climbed } = pace;
  if (level === 0 || recent.length < ENOUGH_FRAMES || now - changedAt < HOLD_MS) return null;
  if (!climbed && isTooSoon(pace, now)) return null;
  const usual = quantile(recent, COUNTED);
  const known = knowledge(pace, usual, now, rules);
  const next = predict(level - 1, known);
  const peakOf = Math.max(1, (peak.load * measured[level].share) / usual);
  if (peakOf * next > TOO_SLOW * rules.targetMs && peakOf > TOO_SLOW) return null;
  if (next <= TO_SPARE * rules.targetMs) return change(pace, now, level - 1, 'spare', recent);
  const isHopeful = !isBelieved(level - 1, known);
  const isGuess = !isAnyKnownAbove(known);
  const hoped = isHopeful ? predict(level - 1, { ...known, isHopeful }) / (isGuess ? TOO_SLOW : 1) : next;
  const isNoDearer = climbed && isHopeful && usual <= rules.targetMs && hasCostNothing(pace);
  const isTried = isNoDearer || (hoped <= rules.targetMs && now - changedAt >= TRIAL_MS);
  return isTried ? change(pace, now, level - 1, 'trial', recent) : null;
}

/** The last climb has cost nothing. */
function hasCostNothing({ level, measured }: Pace): boolean {
  const below = measured[level + 1];
  return below !== undefined && measured[level].share <= AS_FAST * below.share;
}

function change(pace: Pace, now: number, level: number, reason: PaceReason, frames: readonly number[]): Pace {
  const { measured, peak, changedAt } = pace;
  const load = quantile(frames, 0.5) / measured[pace.level].share;
  const climbed = level < pace.level;
  const turns = climbed !== pace.climbed && changedAt > -Infinity;
  return {
    ...pace,
    level,
    reason,
    recent: [],
    changedAt: now,
    turnedAt: turns ? now : pace.turnedAt,
    hurriedAt: turns && isTooSoon(pace, now) ? now : pace.hurriedAt,
    climbed,
    measured: { ...measured, [pace.level]: { ...measured[pace.level], at: now, load } },
    load,
    peak: load >= peak.load ? { load, at: now } : peak,
    patience: turns && !climbed ? patienceAfterFall(pace, now) : pace.patience,
  };
}

/** Longer where the climb before the fall is regretted. */
function patienceAfterFall(pace: Pace, now: number): number {
  return isTooSoon(pace, now) ? Math.min(LONGEST_PATIENCE_MS, LONGER_PATIENCE * pace.patience) : PATIENCE_MS;
}

/**
 * The pace where pictures have so many times the pixels, and only the first so many rungs serve: what was measured says nothing of these. Fewer pixels are drawn with as
 * many of them as before, for they take no longer: the rung was chosen for what the larger picture took.
 * @param costs of all rungs, as in {@link PaceRules}
 */
export function resized(pace: Pace, growth: number, rungs: number, costs: readonly number[]): Pace {
  const { recent, measured, load, peak } = INITIAL_PACE;
  const asMany = costs.findIndex((cost) => growth * cost <= costs[pace.level]);
  const level = Math.min(pace.level, rungs - 1, asMany === -1 ? Infinity : asMany);
  return { ...pace, level, recent, measured, load, peak };
}

/** The smallest of the values that at least this share of them do not exceed. */
export function quantile(values: readonly number[], share: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.max(0, Math.ceil(share * sorted.length) - 1))];
}
