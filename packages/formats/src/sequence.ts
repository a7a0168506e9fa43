import { grouped } from './bytes.js';
import { damaged } from './damaged.js';
import { MAX_MANIFEST_BYTES } from './is-sequence.js';
import { parseJson, show } from './json.js';

/** Scene files that follow one another in time. */
export interface SceneSequence {
  /** Paths relative to the manifest, in order; each is a scene file of any format. */
  readonly frames: readonly string[];
  readonly framesPerSecond: number;
  /** Seconds from the first frame to the end of the last. */
  readonly durationSeconds: number;
}

const MAX_FRAMES = 1_000_000;
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
  const json = parseJson(bytes, name, MAX_MANIFEST_BYTES);
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
  const paths = typeof frames === 'string' ? numbered(frames, count, fail) : frames;
  const isList = Array.isArray(paths) && paths.length > 0 && paths.length <= MAX_FRAMES;
  if (!isList || !paths.every((path) => typeof path === 'string' && path !== '')) {
    return fail('frames', `1 to ${grouped(MAX_FRAMES)} paths, or one with {0001} in it`, frames);
  }
  return {
    frames: paths,
    framesPerSecond: framesPerSecond as number,
    durationSeconds: paths.length / (framesPerSecond as number),
  };
}

/** The number of the frame that is shown at a time; times before the first and after the last frame give these, or wrap around. */
export function frameAt({ frames, framesPerSecond }: SceneSequence, timeSeconds: number, loop = false): number {
  // The small number: 1/24 s times 24 must not fall into the frame before.
  const frame = Math.floor(timeSeconds * framesPerSecond + 1e-6);
  const last = frames.length - 1;
  return loop ? ((frame % frames.length) + frames.length) % frames.length : Math.min(last, Math.max(0, frame || 0));
}

type Fail = (path: string, expected: string, found: unknown) => never;

function numbered(pattern: string, count: unknown, fail: Fail): string[] {
  const [, before, digits, behind] = PATTERN.exec(pattern) ?? fail('frames', 'a path with {0001} in it', pattern);
  if (!Number.isInteger(count) || (count as number) < 1 || (count as number) > MAX_FRAMES) {
    fail('count', `1 to ${grouped(MAX_FRAMES)} frames`, count);
  }
  const first = Number(digits);
  return Array.from(
    { length: count as number },
    (_, k) => before + String(first + k).padStart(digits.length, '0') + behind,
  );
}
