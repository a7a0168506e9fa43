/** How much of the true image a moving picture can afford: a pure function of what frames took. */

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
  /** When the level last changed. */
  readonly changedAt: number;
  /** The last change was towards the true image. */
  readonly climbed: boolean;
  /** Level before the last change, or before the first of several falls that won nothing. */
  readonly from: number;
  /** What frames took then, or before the first of several climbs to rungs that are no dearer, ms. */
  readonly before: number;
  /** When the level last changed its direction. */
  readonly turnedAt: number;
  /** A rung below which frames were no faster, what they took there, ms, and until when that is believed. */
  readonly floor: { readonly level: number; readonly milliseconds: number; readonly until: number } | null;
  /** No climb to a rung before this time, and how often one to it was in vain. */
  readonly barred: Readonly<Record<number, { readonly until: number; readonly failures: number }>>;
}

/** `start`: nothing is known yet; `slow`: frames took too long; `spare`: there was time to spare; `trial`: more of the picture takes no longer, or it may be so. */
export type PaceReason = 'start' | 'slow' | 'spare' | 'trial';

/** Frames that are remembered, and the share of them that counts: a slow frame now and then is nobody's fault. */
const MEMORY = 20;
const COUNTED = 0.8;
/** Frames are too slow from this share of the target on, and time to spare begins under the other: the dead band lies between. */
const TOO_SLOW = 1.05;
const TO_SPARE = 0.9;
/** Two or three frames in a row suffice where all are as slow as this. */
const TWO_FRAMES_SLOW = 4;
const THREE_FRAMES_SLOW = 1.25;
/** Frames that are looked at before a small excess counts, and before a climb. */
const ENOUGH_FRAMES = 12;
/** Between a change and a climb, ms. */
const HOLD_MS = 500;
/**
 * After so long without a change, ms, a rung up is tried whatever it can cost: wide GPUs were seen to take longer for few pixels than for many. Where the frames
 * then take no longer, within the tolerance, the pace stays there, and the next rung is tried after a hold.
 */
const TRIAL_MS = 6_000;
const NO_LONGER = 1.05;
/** A rung down is taken back where, this soon after it, ms, all of three frames take so much longer than those before: small pictures leave most of a wide GPU idle. */
const HARM_MS = 1_000;
const HARMFUL = 1.25;
/** So are all rungs where the lowest has not brought frames below such a share: the picture would be less for nothing. */
const IN_VAIN = 0.95;
/** A rung up that took frames down to such a share is followed by the next without a hold. */
const FASTER = 0.9;
/** Between two changes of direction, ms, five seconds and what times may be late: a level that goes to and fro is seen. Only a fall to what was in time comes sooner. */
const QUIET_MS = 5_200;
/** A change that makes frames so much longer is taken back sooner. */
const MUCH_DEARER = 1.6;
/** How long, ms, it is believed that rungs win nothing. */
const FLOOR_MS = 20_000;
/** A climb that ends sooner, ms, was in vain; the rung is then left alone for a while, each time for twice as long. */
const IN_VAIN_MS = 2_000;
const FIRST_BAR_MS = 5_000;
const LONGEST_BAR_MS = 80_000;

/** Before the first frame. */
export const INITIAL_PACE: Pace = {
  level: 0,
  reason: 'start',
  recent: [],
  changedAt: -Infinity,
  climbed: false,
  from: 0,
  before: 0,
  turnedAt: -Infinity,
  floor: null,
  barred: {},
};

/** The pace after a frame. Frames of another level than the current one are too late to say anything. */
export function keepPace(pace: Pace, { now, level, milliseconds }: FrameSample, rules: PaceRules): Pace {
  if (level !== pace.level) return pace;
  const known = { ...pace, recent: [...pace.recent, milliseconds].slice(-MEMORY) };
  const isLowest = level + 1 === rules.costs.length;
  if (isHarmful(known, now) || (isLowest && isForNothing(known, now))) return takeBack(known, now);
  const excess = excessOf(known.recent, rules.targetMs);
  if (excess !== null && !isLowest && !isKeptThough(known, now)) return fall(known, now, excess, rules);
  const reason = climbReason(known, now, rules);
  return reason === null ? known : change(known, now, level - 1, reason);
}

/** It is too soon after the last change of direction for another one. */
const isTooSoon = ({ turnedAt }: Pace, now: number): boolean => now - turnedAt < QUIET_MS;

const isMuchDearer = ({ recent, before }: Pace): boolean => Math.min(...recent.slice(-3)) > MUCH_DEARER * before;

/** Back to where the falls began that have won nothing, or have made frames longer. */
function takeBack(pace: Pace, now: number): Pace {
  const { from, before } = pace;
  if (isTooSoon(pace, now) && !isMuchDearer(pace)) return pace;
  return { ...change(pace, now, from, 'trial'), floor: { level: from, milliseconds: before, until: now + FLOOR_MS } };
}

/** How long frames take where they take too long, as a share of the target; null where they do not. */
function excessOf(recent: readonly number[], targetMs: number): number | null {
  const [two, three] = [recent.slice(-2), recent.slice(-3)];
  if (two.length === 2 && Math.min(...two) > TWO_FRAMES_SLOW * targetMs) return Math.min(...two) / targetMs;
  if (three.length === 3 && Math.min(...three) > THREE_FRAMES_SLOW * targetMs) return quantile(three, 0.5) / targetMs;
  const usual = recent.length >= ENOUGH_FRAMES ? quantile(recent, COUNTED) / targetMs : 0;
  return usual > TOO_SLOW ? usual : null;
}

/** Multiplicative decrease: to the first rung whose cost would do, were all of the cost in what the rungs take away. */
function fall(pace: Pace, now: number, excess: number, { costs, targetMs }: PaceRules): Pace {
  const { level, climbed, changedAt, barred, before, from } = pace;
  const affordable = costs[level] / excess;
  const found = costs.findIndex((cost, rung) => rung > level && cost <= affordable);
  const wished = found === -1 ? costs.length - 1 : found;
  // Where what is below was too slow as well there is no hurry, unless it was much less so, and nothing to be won further down.
  const wasTooSlow = climbed && before > TOO_SLOW * targetMs;
  if (wasTooSlow && isTooSoon(pace, now) && !isMuchDearer(pace)) return pace;
  const floor = wasTooSlow ? { level: from, milliseconds: before, until: now + FLOOR_MS } : floorOf(pace, now);
  const lowest = floor?.level ?? costs.length - 1;
  if (level >= lowest) return pace;
  // The last frames, not those before the load grew. Falls that win nothing are held against the frames before the first.
  const isInVain = !climbed && now - changedAt < HARM_MS && excess * targetMs >= IN_VAIN * before;
  const held = isInVain ? { before, from } : { before: excess * targetMs, from: level };
  const next = { ...change(pace, now, Math.min(wished, lowest), 'slow'), ...held, floor };
  if (!climbed || (now - changedAt > IN_VAIN_MS && !wasTooSlow)) return next;
  const failures = (barred[level]?.failures ?? 0) + 1;
  const until = now + Math.min(LONGEST_BAR_MS, FIRST_BAR_MS * 2 ** (failures - 1));
  return { ...next, barred: { ...barred, [level]: { until, failures } } };
}

/** Where falling ends for now; null where nothing is known, or the load has grown since. */
function floorOf({ floor, recent, level }: Pace, now: number): Pace['floor'] {
  if (floor === null || now >= floor.until) return null;
  const hasGrown = level >= floor.level && Math.min(...recent.slice(-3)) > HARMFUL * floor.milliseconds;
  return hasGrown ? null : floor;
}

/** Additive increase: one rung, after a hold, if its frames would be in time even at the most that it can cost; or to try it. Null: stay. */
function climbReason(pace: Pace, now: number, { costs, targetMs }: PaceRules): PaceReason | null {
  const { level, recent, changedAt, barred } = pace;
  if (level === 0 || now - changedAt < holdOf(pace) || recent.length < ENOUGH_FRAMES) return null;
  if (isBarred(barred, level - 1, now)) return null;
  const usual = quantile(recent, COUNTED);
  const turns = !pace.climbed && changedAt > -Infinity;
  if (turns && isTooSoon(pace, now)) return null;
  if (usual * (costs[level - 1] / costs[level]) <= TO_SPARE * targetMs) return 'spare';
  return now - changedAt >= TRIAL_MS || isNoDearer(pace) ? 'trial' : null;
}

/** Frames take longer than on the rung above, from which the pace has fallen. */
function isHarmful({ recent, climbed, changedAt, before }: Pace, now: number): boolean {
  const three = recent.slice(-3);
  return !climbed && three.length === 3 && now - changedAt < HARM_MS && Math.min(...three) > HARMFUL * before;
}

/** Frames take as long as before the pace fell: looked at once, when there are enough of them. Not where that was a fall from a climb in vain: what is dearer there is known. */
function isForNothing({ recent, climbed, before, reason, barred, from }: Pace, now: number): boolean {
  const isDue = !climbed && reason === 'slow' && recent.length === ENOUGH_FRAMES && !isBarred(barred, from, now);
  return isDue && quantile(recent, 0.5) >= IN_VAIN * before;
}

const isBarred = (barred: Pace['barred'], level: number, now: number): boolean =>
  now < (barred[level]?.until ?? -Infinity);

/** What is too slow stays where the rung below was no faster, until that is long ago. */
function isKeptThough(pace: Pace, now: number): boolean {
  return isNoDearer(pace) && now - pace.changedAt < LONGEST_BAR_MS;
}

function holdOf({ recent, climbed, before }: Pace): number {
  return climbed && quantile(recent, COUNTED) <= FASTER * before ? 0 : HOLD_MS;
}

/** Frames take no longer than on the rung below, from which the pace has climbed: there is nothing to be won there. */
function isNoDearer({ recent, climbed, before }: Pace): boolean {
  return climbed && quantile(recent, COUNTED) <= NO_LONGER * before;
}

function change(pace: Pace, now: number, level: number, reason: PaceReason): Pace {
  const usual = quantile(pace.recent, COUNTED);
  const climbed = level < pace.level;
  // Rungs that are no dearer than one another must not add up to one that is.
  const before = climbed && isNoDearer(pace) ? Math.min(pace.before, usual) : usual;
  const turnedAt = climbed !== pace.climbed && pace.changedAt > -Infinity ? now : pace.turnedAt;
  return { ...pace, level, reason, recent: [], changedAt: now, climbed, from: pace.level, before, turnedAt };
}

/** The pace where only the first so many rungs serve. */
export function withinRungs(pace: Pace, rungs: number): Pace {
  return pace.level < rungs ? pace : { ...pace, level: rungs - 1, recent: [] };
}

/** The smallest of the values that at least this share of them do not exceed. */
export function quantile(values: readonly number[], share: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.max(0, Math.ceil(share * sorted.length) - 1))];
}
