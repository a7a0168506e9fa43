import { GaussianSplatError, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import {
  FADE_NAMES,
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
 * Quantization steps of motion: `position` in units of the scene, `rotation` in radians, `scale` in natural logarithms.
 * `opacity` and `color` (constant coefficients) have the units of these attributes.
 */
export type MotionSteps = Steps<AnimatedAttributeName>;

export interface MotionOptions {
  readonly steps: MotionSteps;
  readonly deflate: Deflate;
}

/** Fraction of a step below which weights become 0, because zeros need almost no bits. */
const DEAD_ZONE = 0.6;
/** Fraction of a step below which the root mean square weight of a curve is too small to keep the curve. */
const MIN_CURVE = 0.12;
const MAX_CODE = 32_767;
/** Empty last block of a deflate stream. */
const END = Uint8Array.of(3, 0);

/** Quantized motion of an attribute, as a file contains it. */
export type WrittenPart = AnimatedAttribute;

/** Principal curves of an attribute's numbers, strongest first. A row is a number of a splat over the frames. */
export interface Followed {
  /** Count of rows: numbers of the attribute times splats. */
  readonly rows: number;
  readonly frames: number;
  /** Values of each curve, [frames]. */
  readonly curves: readonly Float64Array[];
  /** For each curve, its weight for each row, [rows]. */
  readonly shares: readonly Float32Array[];
}

/**
 * Writes a motion file: the differences of frames from the first frame of a sequence with corresponding splats. The file
 * has the principal curves of each attribute over its frames, and the weights of the curves for each splat.
 * @param first First frame, as read from its file.
 * @param frames Frames of the file, with the order of axes of the first frame: see `alignAxes`.
 * @throws GaussianSplatError `argument/value` for frames with a different number of splats.
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

/** Returns the bytes of a motion file. `parts` has the motion of each of {@link ANIMATED_ATTRIBUTE_NAMES}, in order. */
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
  const version = lives ? MOTION_VERSION[lives.fades ? 'fades' : 'lives'] : MOTION_VERSION.everywhere;
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
  const begin = concatenated(Uint8Array, [bytesOf(head), bytesOf(curves), modes]);
  const lifetimes = lives ? [lives.first, lives.end].flatMap((words) => halvesOf(words).map(deflate)) : [];
  const { fades } = lives ?? {};
  if (fades) lifetimes.push(...FADE_NAMES.map((name) => deflate(fades[name])));
  return concatenated(Uint8Array, [deflate(begin), ...lifetimes, ...planes.map(({ bytes }) => bytes), END]);
}

/** Returns the low bytes of 16-bit words, and their high bytes. */
const halvesOf = (words: Uint16Array): readonly Uint8Array[] => [
  Uint8Array.from(words, (word) => word & 255),
  Uint8Array.from(words, (word) => word >> 8),
];

/**
 * Returns the difference of each number of an attribute from the first frame, [numbers · splats, frames]. Undefined if no
 * number changes.
 */
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
  { origin }: GaussianCloud,
): (cloud: GaussianCloud, i: number, number: number) => number {
  const min = 1e-12;
  return {
    position: (cloud: GaussianCloud, i: number, k: number) =>
      cloud.positions[3 * i + k] + (cloud.origin[k] - origin[k]),
    scale: ({ scales }: GaussianCloud, i: number, k: number) => Math.log(Math.max(min, scales[3 * i + k])),
    opacity: ({ opacities }: GaussianCloud, i: number) => opacities[i],
    color: ({ sh, shDegree }: GaussianCloud, i: number, k: number) => sh[3 * shCoefficientCount(shDegree) * i + k],
  }[name];
}

/** Writes rotation vectors from the first frame. Of the vectors of a rotation, selects that nearest to the previous frame. */
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

/**
 * Writes to `turn` the quaternion that rotates one orientation to another, to · from⁻¹.
 * @param at Index of the first component in both arrays.
 */
export function turnBetween(from: Float32Array, to: Float32Array, at: number, turn: Float64Array): void {
  const [w, x, y, z] = [from[at], -from[at + 1], -from[at + 2], -from[at + 3]];
  const [a, b, c, d] = [to[at], to[at + 1], to[at + 2], to[at + 3]];
  turn[0] = a * w - b * x - c * y - d * z;
  turn[1] = a * x + b * w + c * z - d * y;
  turn[2] = a * y - b * z + c * w + d * x;
  turn[3] = a * z + b * y - c * x + d * w;
}

export const UNCHANGED: WrittenPart = { rank: 0, step: 1, curves: new Float32Array(0), codes: [] };

/** Returns the minimum root mean square weight of a curve for a quantization step. */
export const minCurve = (step: number): number => MIN_CURVE * step;

/**
 * Returns the principal curves of rows, and their weights.
 * @param changes [rows, frames] differences.
 * @param min Minimum root mean square weight of a curve; see {@link minCurve}.
 */
export function followed(changes: Float32Array, frames: number, min: number): Followed {
  const curves = mainCurves(changes, frames, min);
  return { rows: changes.length / frames, frames, curves, shares: curves.map((curve) => sharesOf(changes, curve)) };
}

/** Returns the weight of a curve for each row, [rows]. @param changes [rows, frames] differences. */
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

/**
 * Quantizes weights with a step, or with a larger step if codes would overflow 16 bits. Drops curves whose codes are all
 * 0.
 */
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

/** Returns the compressed low and high bytes of codes, plain or as differences, whichever is smaller. */
function smaller(codes: Int16Array, deflate: MotionOptions['deflate']): { mode: number; bytes: Uint8Array } {
  const differences = codes.map((code, i) => code - (i > 0 ? codes[i - 1] : 0));
  const [plain, changed] = [codes, differences].map((own) => {
    const planes = new Uint8Array(2 * own.length);
    own.forEach((code, i) => {
      const folded = (code << 1) ^ (code >> 15);
      planes[i] = folded & 255;
      planes[own.length + i] = (folded >> 8) & 255;
    });
    return concatenated(Uint8Array, [deflate(planes.subarray(0, own.length)), deflate(planes.subarray(own.length))]);
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
