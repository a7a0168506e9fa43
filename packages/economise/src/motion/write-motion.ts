import { concatenated } from '../concatenated.js';
import { GaussianSplatError, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import {
  MOTION_MODES,
  MOTION_VERSION,
  ANIMATED_ATTRIBUTES,
  ANIMATED_ATTRIBUTE_NAMES,
  type Lives,
  type AnimatedAttributeName,
  type AnimatedAttribute,
} from '@gaussian-splat/formats';
import type { Deflate } from '../pages/page-planes.js';
import type { Steps } from '../steps.js';
import { mainCurves } from './main-curves.js';

/**
 * Quantization steps: `position` in world units, `rotation` in radians, `scale` in natural logarithms, `opacity` and
 * `color` (the constant coefficient) in their own units.
 */
export type MotionSteps = Steps<AnimatedAttributeName>;

export interface MotionOptions {
  readonly steps: MotionSteps;
  readonly deflate: Deflate;
}

/** Codes below this fraction of a step become 0, because zeros cost almost no bits. */
const DEAD_ZONE = 0.6;
/** Curves with typical weights below this fraction of a step are dropped. */
const MIN_CURVE = 0.12;
const MAX_CODE = 32_767;
/** An empty last block of a deflate stream. */
const END = Uint8Array.of(3, 0);

/** Motion of one attribute as written. */
export type WrittenPart = AnimatedAttribute;

/** The principal curves of an attribute's numbers, strongest first. */
export interface Followed {
  /** [width · splats] animated numbers. */
  readonly rows: number;
  readonly frames: number;
  /** [frames] each. */
  readonly curves: readonly Float64Array[];
  /** [rows] for each curve: its weight for each number. */
  readonly shares: readonly Float32Array[];
}

/**
 * Writes a file of motion: the differences of frames from the first frame of their sequence, with corresponding splats.
 * The principal curves of each attribute are computed over the frames of the file; the weights of each splat are
 * stored.
 * @param first As read back from its file.
 * @param frames With the axis order of the first frame: see `alignAxes`.
 * @throws GaussianSplatError `argument/value` for frames with other splats.
 */
export function writeMotion(
  first: GaussianCloud,
  frames: readonly GaussianCloud[],
  { steps, deflate }: MotionOptions,
): Uint8Array<ArrayBuffer> {
  const other = frames.find(({ count }) => count !== first.count);
  if (other) throw notCorresponding(first.count, other.count);
  const parts = ANIMATED_ATTRIBUTE_NAMES.map((name): WrittenPart => {
    const changes = changesOf(first, frames, name);
    if (changes === undefined) return UNCHANGED;
    return roundedPart(followed(changes, frames.length, minCurve(steps[name])), steps[name], first.count);
  });
  return motionFile({ splats: first.count, frames: frames.length, parts, deflate });
}

/** Writes a file of motion with {@link ANIMATED_ATTRIBUTE_NAMES}, in their order. */
export function motionFile({
  splats,
  frames,
  parts,
  lives,
  deflate,
}: {
  splats: number;
  frames: number;
  parts: readonly WrittenPart[];
  lives?: Lives;
  deflate: Deflate;
}): Uint8Array<ArrayBuffer> {
  const version = lives ? MOTION_VERSION.lives : MOTION_VERSION.everywhere;
  const head = new DataView(new ArrayBuffer(12 + 8 * parts.length));
  [version, splats, frames].forEach((number, k) => head.setUint32(4 * k, number, true));
  parts.forEach(({ rank, step }, k) => {
    head.setUint32(12 + 8 * k, rank, true);
    head.setFloat32(16 + 8 * k, step, true);
  });
  const curves = new DataView(new ArrayBuffer(4 * parts.reduce((sum, part) => sum + part.curves.length, 0)));
  parts.flatMap((part) => [...part.curves]).forEach((value, k) => curves.setFloat32(4 * k, value, true));
  const planes = parts.flatMap(({ codes }) => codes.map((own) => smaller(own, deflate)));
  const modes = Uint8Array.from(planes, ({ mode }) => mode);
  const begin = concatenated([bytesOf(head), bytesOf(curves), modes]);
  const lifetimes = lives ? [lives.first, lives.end].flatMap((words) => halvesOf(words).map(deflate)) : [];
  return concatenated([deflate(begin), ...lifetimes, ...planes.map(({ bytes }) => bytes), END]);
}

/** The low bytes of words, and the high ones. */
const halvesOf = (words: Uint16Array): readonly Uint8Array[] => [
  Uint8Array.from(words, (word) => word & 255),
  Uint8Array.from(words, (word) => word >> 8),
];

/** [width · splats, frames] difference of each number from the first frame; undefined if all are unchanged. */
function changesOf(
  first: GaussianCloud,
  frames: readonly GaussianCloud[],
  name: AnimatedAttributeName,
): Float32Array | undefined {
  const { count } = first;
  const changes = new Float32Array(ANIMATED_ATTRIBUTES[name] * count * frames.length);
  let hasChanged = false;
  const put = (number: number, i: number, frame: number, value: number): void => {
    changes[(number * count + i) * frames.length + frame] = value;
    if (value !== 0) hasChanged = true;
  };
  if (name === 'rotation') putTurns(first, frames, put);
  else {
    const of = numbersOf(name, first);
    frames.forEach((cloud, frame) => {
      for (let i = 0; i < count; i++) {
        for (let number = 0; number < ANIMATED_ATTRIBUTES[name]; number++)
          put(number, i, frame, of(cloud, i, number) - of(first, i, number));
      }
    });
  }
  return hasChanged ? changes : undefined;
}

function numbersOf(
  name: Exclude<AnimatedAttributeName, 'rotation'>,
  { shDegree, origin }: GaussianCloud,
): (cloud: GaussianCloud, i: number, number: number) => number {
  const stride = 3 * shCoefficientCount(shDegree);
  const min = 1e-12;
  return {
    position: (cloud: GaussianCloud, i: number, k: number) =>
      cloud.positions[3 * i + k] + (cloud.origin[k] - origin[k]),
    scale: ({ scales }: GaussianCloud, i: number, k: number) => Math.log(Math.max(min, scales[3 * i + k])),
    opacity: ({ opacities }: GaussianCloud, i: number) => opacities[i],
    color: ({ sh }: GaussianCloud, i: number, k: number) => sh[stride * i + k],
  }[name];
}

/** Rotation vectors, each in the branch nearest to that of the previous frame. */
function putTurns(
  first: GaussianCloud,
  frames: readonly GaussianCloud[],
  put: (number: number, i: number, frame: number, value: number) => void,
): void {
  const turn = new Float64Array(4);
  for (let i = 0; i < first.count; i++) {
    const last = [1, 0, 0, 0];
    frames.forEach(({ rotations }, frame) => {
      turnBetween(first.rotations, rotations, 4 * i, turn);
      if (last.reduce((sum, value, k) => sum + value * turn[k], 0) < 0) for (let k = 0; k < 4; k++) turn[k] = -turn[k];
      for (let k = 0; k < 4; k++) last[k] = turn[k];
      const [w, x, y, z] = turn;
      const length = Math.hypot(x, y, z);
      const factor = length > 1e-12 ? (2 * Math.atan2(length, w)) / length : 2;
      put(0, i, frame, factor * x);
      put(1, i, frame, factor * y);
      put(2, i, frame, factor * z);
    });
  }
}

/** The quaternion that rotates one orientation to another. */
export function turnBetween(from: Float32Array, to: Float32Array, at: number, turn: Float64Array): void {
  const [w, x, y, z] = [from[at], -from[at + 1], -from[at + 2], -from[at + 3]];
  const [a, b, c, d] = [to[at], to[at + 1], to[at + 2], to[at + 3]];
  turn[0] = a * w - b * x - c * y - d * z;
  turn[1] = a * x + b * w + c * z - d * y;
  turn[2] = a * y - b * z + c * w + d * x;
  turn[3] = a * z + b * y - c * x + d * w;
}

export const UNCHANGED: WrittenPart = { rank: 0, step: 1, curves: new Float32Array(0), codes: [] };

/** Minimum typical weight of a curve at a step. */
export const minCurve = (step: number): number => MIN_CURVE * step;

/**
 * @param changes [rows, frames]
 * @param least See {@link minCurve}.
 */
export function followed(changes: Float32Array, frames: number, min: number): Followed {
  const curves = mainCurves(changes, frames, min);
  return { rows: changes.length / frames, frames, curves, shares: curves.map((curve) => sharesOf(changes, curve)) };
}

/** [rows] weight of a curve for each row. */
export function sharesOf(changes: Float32Array, curve: Float64Array): Float32Array {
  const frames = curve.length;
  const shares = new Float32Array(changes.length / frames);
  for (let row = 0, at = 0; row < shares.length; row++) {
    let sum = 0;
    for (let f = 0; f < frames; f++) sum += changes[at++] * curve[f];
    shares[row] = sum / frames;
  }
  return shares;
}

/** Quantizes with a step, or with a larger one if codes would overflow; drops curves that become unused. */
export function roundedPart(
  { rows, frames, curves: found, shares }: Followed,
  asked: number,
  splats: number,
): WrittenPart {
  const max = shares.reduce((all, own) => own.reduce((largest, value) => Math.max(largest, Math.abs(value)), all), 0);
  const step = Math.fround(Math.max(asked, max / MAX_CODE));
  const codes = shares.map((own) =>
    Int16Array.from(own, (value) => (Math.abs(value) < DEAD_ZONE * step ? 0 : Math.round(value / step))),
  );
  const kept = codes.map((own, k) => ({ own, k })).filter(({ own }) => own.some((code) => code !== 0));
  const rank = kept.length;
  if (rank === 0) return UNCHANGED;
  const curves = new Float32Array(frames * rank);
  kept.forEach(({ k }, at) => found[k].forEach((value, f) => (curves[rank * f + at] = value)));
  const width = rows / splats;
  const ofNumber = (number: number): Int16Array[] =>
    kept.map(({ own }) => own.subarray(splats * number, splats * (number + 1)));
  return { rank, step, curves, codes: Array.from({ length: width }, (_, number) => ofNumber(number)).flat() };
}

/** Codes as two planes of bytes, in the smaller of both codings. */
function smaller(codes: Int16Array, deflate: MotionOptions['deflate']): { mode: number; bytes: Uint8Array } {
  const differences = codes.map((code, i) => code - (i > 0 ? codes[i - 1] : 0));
  const [plain, changed] = [codes, differences].map((own) => {
    const planes = new Uint8Array(2 * own.length);
    own.forEach((code, i) => {
      const folded = (code << 1) ^ (code >> 15);
      planes[i] = folded & 255;
      planes[own.length + i] = (folded >> 8) & 255;
    });
    return concatenated([deflate(planes.subarray(0, own.length)), deflate(planes.subarray(own.length))]);
  });
  return plain.length <= changed.length
    ? { mode: MOTION_MODES.plain, bytes: plain }
    : { mode: MOTION_MODES.differences, bytes: changed };
}

const bytesOf = ({ buffer }: DataView): Uint8Array => new Uint8Array(buffer);

const notCorresponding = (expected: number, found: number): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'frames of a sequence',
    expected: `${expected} splats in each, the same ones in the same order`,
    found: `one of ${found}`,
    remedy: 'keep scene files for such frames: {"gaussianSplatSequence": 1, ...}',
  });
