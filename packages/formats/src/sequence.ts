import { LoadBudget } from './budget.js';
import { grouped } from './bytes.js';
import { damaged } from './faults.js';
import { parseJson, show, type Json } from './json.js';
import { MAX_PATH } from './lod/meta.js';
import { MAX_MANIFEST_BYTES } from './signatures.js';

/** A sequence of scene files over time. */
export interface SceneSequence {
  /**
   * Paths of scene files of any format, relative to the manifest, or the pattern of these paths. Each frame has a scene
   * file; with {@link motion}, only the first frame has one. See {@link framePath}.
   */
  readonly frames: readonly string[] | FramePattern;
  /**
   * Motion files, which contain the differences of later frames from the first. Undefined if each frame has a scene file.
   * See {@link motionFrame}.
   */
  readonly motion?: SequenceMotion;
  readonly frameCount: number;
  readonly framesPerSecond: number;
  /** Seconds from the first frame to the end of the last. */
  readonly durationSeconds: number;
}

/** Motion files of the frames after the first. */
export interface SequenceMotion {
  /** Paths of the motion files, relative to the manifest, or the pattern of these paths. */
  readonly frames: readonly string[] | FramePattern;
  /** Number of frames in each motion file. The last file may have fewer. */
  readonly framesPerFile: number;
}

/** Location of a frame in a motion file. */
export interface MovedFrame {
  /** Path of the motion file, relative to the manifest. */
  readonly path: string;
  /** Index of the frame in the motion file, from 0. */
  readonly frame: number;
  /** Number of frames in the motion file. */
  readonly frames: number;
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
/** Maximum number of frames in a motion file, so that its curves are small compared with its codes. */
const MAX_PER_FILE = 4096;
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
 * { "gaussianSplatSequence": 2, "framesPerSecond": 24, "count": 240, "first": "first.sog", "motion": "motion-{00}.bin", "framesPerFile": 48 }
 * ```
 *
 * @throws GaussianSplatError `decode/corrupt`, `decode/truncated`, `decode/header` or `decode/unsupported`.
 */
export function parseSequence(bytes: Uint8Array, name: string): SceneSequence {
  const json = parseJson({ bytes, name, budget: new LoadBudget(bytes.length) }, MAX_MANIFEST_BYTES);
  const fail = (path: string, expected: string, found: unknown): never => {
    throw damaged(`${name}, ${path}`, expected, show(found), 'decode/header');
  };
  const { gaussianSplatSequence: version, framesPerSecond, frames, count } = json;
  if (version !== 1 && version !== 2) {
    throw damaged(`${name}, gaussianSplatSequence`, 'version 1 or 2', show(version), 'decode/unsupported');
  }
  if (!(Number.isFinite(framesPerSecond) && (framesPerSecond as number) > 0 && (framesPerSecond as number) <= 1000)) {
    fail('framesPerSecond', 'a number above 0, 1000 at most', framesPerSecond);
  }
  const sequence = (found: SceneSequence['frames'], frameCount: number): SceneSequence => ({
    frames: found,
    frameCount,
    framesPerSecond: framesPerSecond as number,
    durationSeconds: frameCount / (framesPerSecond as number),
  });
  if (version === 2) return { ...sequence([firstOf(json, fail)], countOf(count, fail)), motion: motionOf(json, fail) };
  if (typeof frames === 'string') return sequence(patternOf(frames, 'frames', fail), countOf(count, fail));
  const paths = pathsOf(frames, 'frames', fail);
  return sequence(paths, paths.length);
}

function firstOf({ first }: Json, fail: Fail): string {
  if (typeof first !== 'string' || first === '') return fail('first', 'the path of a scene file', first);
  requireShort([first], 'first', fail);
  return first;
}

/** Reads the properties of a manifest that describe the motion files. */
function motionOf({ motion, framesPerFile, count }: Json, fail: Fail): SequenceMotion {
  if (!Number.isInteger(framesPerFile) || (framesPerFile as number) < 1 || (framesPerFile as number) > MAX_PER_FILE) {
    fail('framesPerFile', `1 to ${grouped(MAX_PER_FILE)}`, framesPerFile);
  }
  const max = Math.ceil(((count as number) - 1) / (framesPerFile as number));
  const isPattern = typeof motion === 'string';
  const files = isPattern ? patternOf(motion, 'motion', fail) : pathsOf(motion, 'motion', fail, max);
  if (Array.isArray(files) && files.length !== max) fail('motion', `${grouped(max)} paths`, files.length);
  return { frames: files, framesPerFile: framesPerFile as number };
}

/** Returns the location of a frame in a motion file; undefined if the frame has a scene file. */
export function motionFrame({ motion, frameCount }: SceneSequence, frame: number): MovedFrame | undefined {
  if (motion === undefined || frame === 0) return undefined;
  const { framesPerFile } = motion;
  const file = Math.floor((frame - 1) / framesPerFile);
  const begins = 1 + framesPerFile * file;
  const frames = Math.min(framesPerFile, frameCount - begins);
  return { path: framePath(motion, file), frame: frame - begins, frames };
}

/** Iterates over the paths of all files, in the order of the frames that need them. */
export function* sequencePaths(sequence: SceneSequence): Generator<string> {
  const { motion, frameCount } = sequence;
  const own = motion ? 1 : frameCount;
  for (let frame = 0; frame < own; frame++) yield framePath(sequence, frame);
  for (let file = 0; motion && file * motion.framesPerFile < frameCount - 1; file++) yield framePath(motion, file);
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

function pathsOf(paths: unknown, path: string, fail: Fail, min = 1): readonly string[] {
  const isList = Array.isArray(paths) && paths.length >= Math.min(1, min) && paths.length <= MAX_FRAMES;
  if (!isList || !paths.every((each) => typeof each === 'string' && each !== ''))
    return fail(path, `1 to ${grouped(MAX_FRAMES)} paths, or one with {0001} in it`, paths);
  requireShort(paths as string[], path, fail);
  return paths as string[];
}

function countOf(count: unknown, fail: Fail): number {
  if (Number.isInteger(count) && (count as number) >= 1 && (count as number) <= MAX_FRAMES) return count as number;
  return fail('count', `1 to ${grouped(MAX_FRAMES)} frames`, count);
}
