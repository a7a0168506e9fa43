/** Codes a group of frames: as coarsely as the error of its worst frame allows. */
import type { GaussianCloud } from '@gaussian-splat/core';
import {
  ANIMATED_ATTRIBUTES,
  ANIMATED_ATTRIBUTE_NAMES,
  type AnimatedAttributeName,
  type ClipPartContent,
} from '@gaussian-splat/formats';
import { decibels, mean } from '../measure.js';
import { findSteps, fitSteps, scaledSteps, type Steps } from '../steps.js';
import type { Encoding } from '../write/index.js';
import { TrackedPart, type WrittenClipPart } from './clip-part.js';
import { FINER, type MotionSteps } from './curves.js';
import { frameOf, type FrameError, type FrameJudges } from './frame-judges.js';
import { attributeErrors, judgedFrames } from './judged-frames.js';
import type { Tracks } from './tracks.js';

/** Fraction of the allowed error that the scenes of groups may cause; motion may cause the rest. */
export const SCENE_SHARE = 0.4;
const MAX_TRIES = 6;
const NEAR_ENOUGH = 0.75;
/** Number of frames that are added to those measured first, if other frames have larger errors. */
const REMEMBERED = 3;
/** Number of frames that are measured during the search for steps. */
const SEARCHED = 3;
const MUCH_FINER = FINER / 4;
const GROWTHS = [1, 1.25, 1.6, 2, 2.5, 3.2, 4];

export interface GroupCoding {
  readonly tracks: Tracks;
  /** Splats of all tracks. */
  readonly whole: GaussianCloud;
  /** Indices of the tracks of each part. */
  readonly chosen: readonly Uint32Array[];
  /** Parts of the clip that never change, coarse first. */
  readonly still: readonly ClipPartContent[];
  readonly judges: FrameJudges;
  readonly encoding: Encoding;
  /** Steps of the last group; undefined for the first group. */
  readonly steps: MotionSteps | undefined;
  /** Maximum mean squared error of a frame, peak 1. */
  readonly target: number;
  /** Maximum size of the group, bytes. It takes precedence over `target`. */
  readonly maxBytes: number;
  /** Seed of the random frames. */
  readonly seed: number;
  readonly onStep: (step: string) => void;
}

export interface CodedGroup {
  readonly frames: number;
  readonly parts: readonly WrittenClipPart[];
  readonly errors: readonly FrameError[];
}

/** A group, and what the next group begins with. */
export interface FoundGroup extends CodedGroup {
  readonly contents: readonly ClipPartContent[];
  readonly encoding: Encoding;
  readonly steps: MotionSteps;
}

/**
 * Codes a group. The frames with the largest estimated errors are measured first, and some others. If they reach the
 * target, all frames are measured, in more views. The worst ones are among the first of the next attempt. If no steps reach the target, those with the smallest error are used.
 */
export async function codeGroup(coding: GroupCoding): Promise<FoundGroup> {
  const { target, maxBytes } = coding;
  let parts = await partsOf(coding, coding.encoding, coding.steps ?? usualSteps(coding.whole));
  const first = coding.steps ?? (await stepsFor(coding, parts));
  if (isMuchFiner(first, coding.steps ?? usualSteps(coding.whole)))
    parts = await partsOf(coding, coding.encoding, first);
  const tried = new Map<number, Attempt>();
  const isTooLarge = (own: Attempt): boolean => maxBytes < Infinity && sizeOf(own.parts) > maxBytes;
  await fitSteps({
    ...{ steps: { scale: 1 }, target, tries: MAX_TRIES, nearEnough: NEAR_ENOUGH },
    measure: async ({ scale }) => {
      const encoding = scale === 1 ? coding.encoding : coding.encoding.coarser!(scale);
      const found = tried.get(scale) ?? (await attempt(coding, parts, encoding, scaledSteps(first, scale)));
      tried.set(scale, found);
      const error = worstOf(found.errors);
      const size = error <= target ? `${sizeOf(found.parts)} bytes` : 'too coarse';
      coding.onStep(`  ${size}, ${decibels(error).toFixed(2)} dB in the worst frame`);
      // A group that is too large must become coarser, as if its error were too small.
      return { error: isTooLarge(found) ? (0.5 * target * maxBytes) / sizeOf(found.parts) : error };
    },
  });
  const best = [...tried.values()].reduce((one, next) => betterOf(one, next, coding));
  const { frames, contents, isChecked } = best;
  if (isChecked) return best;
  // A group that misses the target is measured in all frames, too, so that its printed error is that of the worst one.
  return { ...best, errors: await coding.judges.errorsInAll(frames, [...coding.still, ...contents]) };
}

/** A group with some steps. Its parts are written when they are first read: those of steps that are too coarse never are. */
interface Attempt extends FoundGroup {
  /** Whether all frames were measured. */
  readonly isChecked: boolean;
}

/**
 * Codes a group with some steps, and measures it.
 * @param found Parts in the encoding of the last group.
 */
async function attempt(
  coding: GroupCoding,
  found: readonly TrackedPart[],
  encoding: Encoding,
  steps: MotionSteps,
): Promise<Attempt> {
  const { tracks, still, judges, target } = coding;
  const parts = encoding === coding.encoding ? found : await Promise.all(found.map((part) => part.recoded(encoding)));
  const contents = parts.map((part) => part.contentAt(steps));
  const estimated = attributeErrors(
    tracks,
    parts.map((part, k) => [part, contents[k]] as const),
  );
  const frames = [...new Set([...judges.frames, ...judgedFrames(estimated, coding.seed)])];
  const shown = [...still, ...contents];
  let errors = await judges.errorsIn(frames, shown);
  const isChecked = worstOf(errors) <= target;
  if (isChecked) {
    errors = await judges.errorsInAll(tracks.frames.length, shown);
    const worst = [...errors].sort((a, b) => b.error - a.error).slice(0, REMEMBERED);
    if (worstOf(worst) > target) await judges.remember(worst.map(({ frame }) => frame));
  }
  let written: readonly WrittenClipPart[] | undefined;
  return {
    ...{ frames: tracks.frames.length, errors, contents, encoding, steps, isChecked },
    get parts() {
      written ??= parts.map((part, k) => part.write(contents[k].motion));
      return written;
    },
  };
}

/** Returns the parts of a group with fixed quantization, unmeasured. */
export async function roundGroup(
  coding: Pick<GroupCoding, 'tracks' | 'whole' | 'chosen'>,
  encoding: Encoding,
  steps: MotionSteps,
): Promise<CodedGroup> {
  const parts = await partsOf(coding, encoding, steps);
  const written = parts.map((part) => part.write(part.contentAt(steps).motion));
  return { frames: coding.tracks.frames.length, parts: written, errors: [] };
}

/** Returns the factor of the scales of coarse parts' splats with the smallest error against all splats of a frame. */
export async function growthIn(judges: FrameJudges, coarse: readonly ClipPartContent[]): Promise<number> {
  const [frame] = judges.frames;
  const cloud = frameOf(coarse, frame);
  let [best, min] = [1, Infinity];
  for (const grow of GROWTHS) {
    const grown = { ...cloud, scales: cloud.scales.map((value) => grow * value) };
    const error = mean(await judges.compare(frame, grown));
    if (error < min) [best, min] = [grow, error];
  }
  return best;
}

/** Returns whether steps are so fine that curves that were found for others may not be enough. */
const isMuchFiner = (steps: MotionSteps, found: MotionSteps): boolean =>
  ANIMATED_ATTRIBUTE_NAMES.some((name) => steps[name] < found[name] / MUCH_FINER);

export const worstOf = (errors: readonly FrameError[]): number =>
  errors.reduce((max, { error }) => Math.max(max, error), 0);

export const sizeOf = (parts: readonly WrittenClipPart[]): number =>
  parts.reduce((sum, { bytes }) => sum + bytes.length, 0);

async function partsOf(
  { tracks, whole, chosen }: Pick<GroupCoding, 'tracks' | 'whole' | 'chosen'>,
  encoding: Encoding,
  steps: MotionSteps,
): Promise<TrackedPart[]> {
  const parts: TrackedPart[] = [];
  for (const own of chosen) parts.push(await TrackedPart.of(tracks, whole, own, encoding, steps));
  return parts;
}

/** Returns the group that fits, has the smaller size if both reach the target, and otherwise the smaller error. */
function betterOf(a: Attempt, b: Attempt, { target, maxBytes }: GroupCoding): Attempt {
  const rank = (own: Attempt): readonly number[] => {
    const worst = worstOf(own.errors);
    if (maxBytes < Infinity && sizeOf(own.parts) > maxBytes) return [2, sizeOf(own.parts)];
    return worst <= target ? [0, sizeOf(own.parts)] : [1, worst];
  };
  const [own, other] = [rank(a), rank(b)];
  return other[0] < own[0] || (other[0] === own[0] && other[1] < own[1]) ? b : a;
}

/** Finds the steps of motion that reach the target in the worst frames, balanced between attributes by {@link findSteps}. */
async function stepsFor(coding: GroupCoding, parts: readonly TrackedPart[]): Promise<MotionSteps> {
  const { tracks, still, judges, target, onStep } = coding;
  const usual = usualSteps(coding.whole);
  const begun = parts.map((part) => part.contentAt(usual));
  const moving = ANIMATED_ATTRIBUTE_NAMES.filter((name) => begun.some(({ motion }) => motion.parts[name].rank > 0));
  if (moving.length === 0) return usual;
  const numbers = Object.fromEntries(moving.map((name) => [name, ANIMATED_ATTRIBUTES[name]])) as Partial<
    Steps<AnimatedAttributeName>
  >;
  const estimated = attributeErrors(
    tracks,
    parts.map((part, k) => [part, begun[k]] as const),
  );
  const judged = judgedFrames(estimated, coding.seed);
  const searched = judged.sort((a, b) => estimated[b] - estimated[a]).slice(0, SEARCHED);
  const measure = async (steps: MotionSteps): Promise<number> =>
    worstOf(await judges.errorsIn(searched, [...still, ...parts.map((part) => part.contentAt(steps))]));
  const { steps } = await findSteps({
    ...{ usual, numbers, measure, target, nearEnough: NEAR_ENOUGH },
    share: (1 - SCENE_SHARE) * target,
    judge: async (tried: MotionSteps) => {
      const error = await measure(tried);
      onStep(`  ${decibels(error).toFixed(2)} dB in the worst of ${searched.length} frames of the first group`);
      return { error };
    },
  });
  return steps;
}

const usualSteps = (cloud: GaussianCloud): MotionSteps => ({
  position: 0.15 * typicalSize(cloud),
  rotation: 0.1,
  scale: 0.1,
  opacity: 0.03,
  color: 0.05,
});

/** Returns the median, over all splats, of their middle standard deviation. */
function typicalSize({ scales, count }: GaussianCloud): number {
  const middle = (i: number): number => [...scales.subarray(3 * i, 3 * i + 3)].sort((a, b) => a - b)[1];
  return Float64Array.from({ length: count }, (_, i) => middle(i)).sort()[count >> 1];
}
