/** What the rungs of the ladder take: those that were measured, and from them the others. */

/** What a rung was measured to take. */
export interface Measured {
  /** As a multiple of the load: what the rung that was measured first would have taken then. */
  readonly share: number;
  /** When, ms. */
  readonly at: number;
  /** Under which load, ms. */
  readonly load: number;
}

/** The rungs that were measured, by number. */
export type MeasuredRungs = Readonly<Record<number, Measured>>;

/** What is known when a time is predicted. */
export interface Knowledge {
  readonly measured: MeasuredRungs;
  /** The rung that is drawn on, which was measured, and what its frames take, ms. */
  readonly level: number;
  readonly milliseconds: number;
  readonly now: number;
  /** Whatever was once measured counts, however long ago. */
  readonly isHopeful?: boolean;
  /** For each rung the most that a frame on it can take, as a share of the first. Falling. */
  readonly costs: readonly number[];
}

/** So long, ms, what was measured is believed whatever the load, and so long where the load is about the same. */
const BELIEVED_MS = 5_000;
const BELIEVED_UNDER_LOAD_MS = 120_000;
const SAME_LOAD = 1.25;
/** A line through two rungs says something of a third where one costs so much more than the other: between like ones it is noise. */
const FAR_APART = 1.2;
/** Rungs that take so little longer than the fastest are as good, and truer. */
export const AS_FAST = 1.05;
/** As many times what a line says beyond its ends is reckoned with: rungs that first win, or cost, little win or cost more than that further on as often as not. */
const TWICE = 2;

/** Whether the rung was measured, and that still counts. */
export function isBelieved(rung: number, { measured, level, milliseconds, now, isHopeful }: Knowledge): boolean {
  const found = measured[rung];
  if (found === undefined) return false;
  if (rung === level || isHopeful) return true;
  const change = milliseconds / measured[level].share / found.load;
  const isSame = change < SAME_LOAD && 1 / change < SAME_LOAD;
  return now - found.at < (isSame ? BELIEVED_UNDER_LOAD_MS : BELIEVED_MS);
}

/**
 * What a frame on a rung would take, ms. Between two rungs that were measured, on the line through them, time against cost. Below them between that line and what
 * the costs say; climbs with nothing measured above cost all that they can, or twice what the line through two rungs below says.
 */
export function predict(rung: number, known: Knowledge): number {
  const { measured, level, milliseconds, costs } = known;
  const timeOf = (other: number): number => (milliseconds * measured[other].share) / measured[level].share;
  if (isBelieved(rung, known)) return timeOf(rung);
  const above = nearest(rung - 1, -1, known);
  const below = nearest(rung + 1, 1, known);
  const onLine = (a: number, b: number): number =>
    timeOf(b) + ((timeOf(a) - timeOf(b)) * (costs[rung] - costs[b])) / (costs[a] - costs[b]);
  const inProportion = (other: number): number => (timeOf(other) * costs[rung]) / costs[other];
  if (below !== null) {
    if (above !== null) return Math.min(onLine(above, below), inProportion(below));
    const far = nearest(below + 1, 1, known, (cost) => FAR_APART * cost <= costs[below]);
    if (far === null) return inProportion(below);
    const dearer = Math.max(0, onLine(below, far) - timeOf(below));
    return Math.min(timeOf(below) + TWICE * dearer, inProportion(below));
  }
  // One of both there is: the level itself.
  const near = above!;
  const far = nearest(near - 1, -1, known, (cost) => cost >= FAR_APART * costs[near]);
  if (far === null) return inProportion(near);
  return Math.max(timeOf(near) - TWICE * (timeOf(near) - onLine(far, near)), inProportion(near));
}

/** The next rung from this one on that was measured and is of such a cost; null where there is none. */
function nearest(
  from: number,
  step: 1 | -1,
  known: Knowledge,
  isOfCost: (cost: number) => boolean = () => true,
): number | null {
  const { costs } = known;
  for (let rung = from; rung >= 0 && rung < costs.length; rung += step) {
    if (isOfCost(costs[rung]) && isBelieved(rung, known)) return rung;
  }
  return null;
}

/** The truest of the rungs that were measured and are as fast as the fastest of them. */
export function fastestKnown(known: Knowledge): number {
  const times = known.costs.map((_, rung) => (isBelieved(rung, known) ? predict(rung, known) : Infinity));
  const best = Math.min(...times);
  return times.findIndex((time) => time <= AS_FAST * best);
}

/**
 * Before less of the picture is given up: the truest rung of a fourth of the cost, if nothing is known of those of half of it. The first rungs say little of these where fewer pixels are dear at first,
 * since they must be made a larger picture again, or where what they won is within the noise. -1 where there is none.
 */
export function firstFarBelow(known: Knowledge): number {
  const { costs, level } = known;
  const isKnown = costs.some((cost, rung) => 2 * cost <= costs[level] && isBelieved(rung, known));
  return level === 0 || isKnown ? -1 : costs.findIndex((cost) => 4 * cost <= costs[level]);
}

/** Whether a truer rung than the one that is drawn on was measured, and that still counts. */
export const isAnyKnownAbove = (known: Knowledge): boolean =>
  known.costs.some((_, rung) => rung < known.level && isBelieved(rung, known));

/**
 * The first rung whose time is within the target; where that is a guess, half-way between it and the first that can be if all of the cost is in what rungs take away: a small step that won little
 * would lead to the last rung. -1 where there is none.
 */
export function firstInTime(times: readonly number[], known: Knowledge, targetMs: number): number {
  const { costs } = known;
  const predicted = times.findIndex((time) => time <= targetMs);
  if (predicted === -1 || isBelieved(predicted, known)) return predicted;
  const affordable = (costs[known.level] * targetMs) / known.milliseconds;
  const possible = costs.findIndex((cost, rung) => rung > known.level && cost <= affordable);
  return possible === -1 ? predicted : Math.min(predicted, Math.ceil((predicted + possible) / 2));
}
