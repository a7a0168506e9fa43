import { LoadBudget } from './budget.js';
import { grouped } from './bytes.js';
import { damaged } from './damaged.js';
import { MAX_MANIFEST_BYTES } from './is-sequence.js';
import { parseJson, show } from './json.js';

/** Scene files that follow one another in time. */
export interface SceneSequence {
  /** Paths relative to the manifest, in order, or how they are made; each is a scene file of any format. See {@link framePath}. */
  readonly frames: readonly string[] | FramePattern;
  /** Number of frames. */
  readonly frameCount: number;
  readonly framesPerSecond: number;
  /** Seconds from the first frame to the end of the last. */
  readonly durationSeconds: number;
}

/** Numbered paths. */
export interface FramePattern {
  readonly before: string;
  readonly behind: string;
  /** Number of the first frame. */
  readonly first: number;
  /** Digits that a number has at least. */
  readonly digits: number;
}

const MAX_FRAMES = 1_000_000;
/** Digits of a number at most: more than are exact. */
const MAX_DIGITS = 15;
/** `frame-{0001}.spz`: the digits say where numbering begins, and how many digits numbers have at least. */
const PATTERN = /^([^{}]*)\{(\d+)\}([^{}]*)$/;

/**
 * Reads the manifest of a sequence:
 *
 * ```json
 * { "gaussianSplatSequence": 1, "framesPerSecond": 24, "frames": ["a.spz", "b.spz"] }
 * { "gaussianSplatSequence": 1, "framesPerSecond": 24, "frames": "frame-{0001}.spz", "count": 240 }
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
  if (version !== 1) {
    throw damaged(`${name}, gaussianSplatSequence`, 'version 1', show(version), 'decode/unsupported');
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
  if (typeof frames === 'string') return sequence(patternOf(frames, count, fail), count as number);
  const isList = Array.isArray(frames) && frames.length > 0 && frames.length <= MAX_FRAMES;
  if (!isList || !frames.every((path) => typeof path === 'string' && path !== '')) {
    return fail('frames', `1 to ${grouped(MAX_FRAMES)} paths, or one with {0001} in it`, frames);
  }
  return sequence(frames as string[], frames.length);
}

/** Path of a frame, relative to the manifest: of a pattern it is made now, for a short one may stand for a million. */
export function framePath({ frames }: Pick<SceneSequence, 'frames'>, frame: number): string {
  if (!('digits' in frames)) return frames[frame];
  const { before, behind, first, digits } = frames;
  return before + String(first + frame).padStart(digits, '0') + behind;
}

/** The number of the frame that is shown at a time; times before the first and after the last frame give these, or wrap around. */
export function frameAt(
  { frameCount, framesPerSecond }: Pick<SceneSequence, 'frameCount' | 'framesPerSecond'>,
  timeSeconds: number,
  loop = false,
): number {
  // The small number: 1/24 s times 24 must not fall into the frame before.
  const frame = Math.floor(timeSeconds * framesPerSecond + 1e-6);
  return loop ? ((frame % frameCount) + frameCount) % frameCount : Math.min(frameCount - 1, Math.max(0, frame || 0));
}

type Fail = (path: string, expected: string, found: unknown) => never;

function patternOf(pattern: string, count: unknown, fail: Fail): FramePattern {
  const [, before, digits, behind] = PATTERN.exec(pattern) ?? fail('frames', 'a path with {0001} in it', pattern);
  if (!Number.isInteger(count) || (count as number) < 1 || (count as number) > MAX_FRAMES) {
    fail('count', `1 to ${grouped(MAX_FRAMES)} frames`, count);
  }
  if (digits.length > MAX_DIGITS) fail('frames', `at most ${MAX_DIGITS} digits`, `${digits.length} of them`);
  return { before, behind, first: Number(digits), digits: digits.length };
}
