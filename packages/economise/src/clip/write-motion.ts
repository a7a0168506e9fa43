import { concatenated } from '@gaussian-splat/core/fetch';
import {
  FADE_NAMES,
  MOTION_MODES,
  MOTION_VERSION,
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

/** Returns the bytes of a motion file. `parts` has the motion of each of `ANIMATED_ATTRIBUTE_NAMES`, in order. */
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
  lives: Lives;
  deflate: Deflate;
}): Uint8Array<ArrayBuffer> {
  const version = MOTION_VERSION[lives.fades ? 'fades' : 'lives'];
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
  const lifetimes = [lives.first, lives.end].flatMap((words) => halvesOf(words).map(deflate));
  const { fades } = lives;
  if (fades) lifetimes.push(...FADE_NAMES.map((name) => deflate(fades[name])));
  return concatenated(Uint8Array, [deflate(begin), ...lifetimes, ...planes.map(({ bytes }) => bytes), END]);
}

/** Returns the low bytes of 16-bit words, and their high bytes. */
const halvesOf = (words: Uint16Array): readonly Uint8Array[] => [
  Uint8Array.from(words, (word) => word & 255),
  Uint8Array.from(words, (word) => word >> 8),
];

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
function smaller(codes: Int16Array, deflate: Deflate): { mode: number; bytes: Uint8Array } {
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
