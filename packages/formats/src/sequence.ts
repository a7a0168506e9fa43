import type { Credits } from '@gaussian-splat/core';
import { LoadBudget } from './budget.js';
import { grouped } from './bytes.js';
import { creditsOf } from './credits.js';
import { damaged } from './faults.js';
import { failIn, parseJson, show, type FailAt } from './json.js';
import { MAX_PATH } from './lod/meta.js';
import { MAX_MANIFEST_BYTES } from './signatures.js';

/** A sequence of scene files over time. */
export interface SceneSequence {
  /** Paths of scene files of any format, relative to the manifest, or the pattern of these paths: see {@link framePath}. */
  readonly frames: readonly string[] | FramePattern;
  readonly frameCount: number;
  readonly framesPerSecond: number;
  /** Seconds from the first frame to the end of the last. */
  readonly durationSeconds: number;
  /** Credits that the manifest declares. */
  readonly credits?: Credits | undefined;
}

/** Numbered paths: `before`, the number of the path, and `behind`. */
export interface FramePattern {
  readonly before: string;
  readonly behind: string;
  /** Number in the first path. */
  readonly first: number;
  /** Minimum number of digits; smaller numbers are padded with zeros. */
  readonly digits: number;
}

const MAX_FRAMES = 1_000_000;
/** Maximum number of digits, so that all numbers are exact integers. */
const MAX_DIGITS = 15;
/** Matches a pattern such as `frame-{0001}.spz`. The digits are the first number, with the minimum number of digits. */
const PATTERN = /^([^{}]*)\{(\d+)\}([^{}]*)$/;

type Fail = (path: string, expected: string, found: unknown) => never;

/**
 * Parses the manifest of a sequence, which has one of these forms:
 *
 * ```json
 * { "gaussianSplatSequence": 1, "framesPerSecond": 24, "frames": ["a.spz", "b.spz"] }
 * { "gaussianSplatSequence": 1, "framesPerSecond": 24, "frames": "frame-{0001}.spz", "count": 240 }
 * ```
 *
 * Both may have `attribution` and `license`.
 *
 * @throws GaussianSplatError `decode/corrupt`, `decode/truncated`, `decode/header` or `decode/unsupported`.
 */
export function parseSequence(bytes: Uint8Array, name: string): SceneSequence {
  const json = parseJson({ bytes, name, budget: new LoadBudget(bytes.length) }, MAX_MANIFEST_BYTES);
  const fail: FailAt = failIn(name);
  const { gaussianSplatSequence: version, framesPerSecond, frames, count } = json;
  if (version !== 1) throw damaged(`${name}, gaussianSplatSequence`, 'version 1', show(version), 'decode/unsupported');
  if (!(Number.isFinite(framesPerSecond) && (framesPerSecond as number) > 0 && (framesPerSecond as number) <= 1000)) {
    fail('framesPerSecond', 'a number above 0, 1000 at most', framesPerSecond);
  }
  const credits = creditsOf(json);
  const sequence = (found: SceneSequence['frames'], frameCount: number): SceneSequence => ({
    frames: found,
    frameCount,
    framesPerSecond: framesPerSecond as number,
    durationSeconds: frameCount / (framesPerSecond as number),
    ...(credits && { credits }),
  });
  if (typeof frames === 'string') return sequence(patternOf(frames, 'frames', fail), countOf(count, fail));
  const paths = pathsOf(frames, 'frames', fail);
  return sequence(paths, paths.length);
}

/** Iterates over the paths of all frames. */
export function* sequencePaths(sequence: SceneSequence): Generator<string> {
  for (let frame = 0; frame < sequence.frameCount; frame++) yield framePath(sequence, frame);
}

/**
 * Returns the path of a frame, relative to the manifest. Patterns are expanded on demand, because a short one may
 * represent a million paths.
 */
export function framePath({ frames }: Pick<SceneSequence, 'frames'>, frame: number): string {
  if (!('digits' in frames)) return frames[frame];
  const { before, behind, first, digits } = frames;
  return before + String(first + frame).padStart(digits, '0') + behind;
}

/**
 * Returns the index of the frame at a time in seconds. Times outside the sequence are clamped to its first or last frame.
 */
export function frameAt(
  { frameCount, framesPerSecond }: Pick<SceneSequence, 'frameCount' | 'framesPerSecond'>,
  timeSeconds: number,
): number {
  // The offset prevents that rounding errors, for example of 1/24 s times 24, select the previous frame.
  const frame = Math.floor(timeSeconds * framesPerSecond + 1e-6);
  return Math.min(frameCount - 1, Math.max(0, frame || 0));
}

/** Throws for paths that no server accepts. A player parses the path of a frame before each request. */
function requireShort(paths: readonly string[], path: string, fail: Fail): void {
  if (paths.some((each) => each.length > MAX_PATH))
    fail(path, `paths of at most ${grouped(MAX_PATH)} characters`, 'longer ones');
}

function patternOf(pattern: string, path: string, fail: Fail): FramePattern {
  requireShort([pattern], path, fail);
  const [, before, digits, behind] = PATTERN.exec(pattern) ?? fail(path, 'a path with {0001} in it', pattern);
  if (digits.length > MAX_DIGITS) fail(path, `at most ${MAX_DIGITS} digits`, `${digits.length} of them`);
  return { before, behind, first: Number(digits), digits: digits.length };
}

function pathsOf(paths: unknown, path: string, fail: Fail): readonly string[] {
  const isList = Array.isArray(paths) && paths.length >= 1 && paths.length <= MAX_FRAMES;
  if (!isList || !paths.every((each) => typeof each === 'string' && each !== ''))
    return fail(path, `1 to ${grouped(MAX_FRAMES)} paths, or one with {0001} in it`, paths);
  requireShort(paths as string[], path, fail);
  return paths as string[];
}

function countOf(count: unknown, fail: Fail): number {
  if (Number.isInteger(count) && (count as number) >= 1 && (count as number) <= MAX_FRAMES) return count as number;
  return fail('count', `1 to ${grouped(MAX_FRAMES)} frames`, count);
}
