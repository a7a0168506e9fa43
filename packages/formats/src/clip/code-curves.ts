/** Model of the curves of motion for the range coder: whole numbers, predicted from the two frames before. */
import type { AnimatedAttribute } from '../motion.js';
import { NumberModel } from './number-model.js';
import type { BitCoder } from './range-coder.js';

/** Numbers of fractional bits of the curves of an attribute, 0 to 20. */
export type CurveBits = readonly number[];

const BITS = 5;
const MAX_BITS = 20;
/** Maximum magnitude of a rounded value, so that differences have less than 24 bits. */
const MAX_VALUE = 2 ** 21;

/** Returns the number of fractional bits of a curve for an error of less than half a step at the largest code. */
export function curveBitsFor(curve: ArrayLike<number>, maxCode: number): number {
  let peak = 0;
  for (let f = 0; f < curve.length; f++) peak = Math.max(peak, Math.abs(curve[f]));
  const wanted = Math.ceil(Math.log2(4 * Math.max(1, maxCode)));
  return Math.max(0, Math.min(MAX_BITS, wanted, Math.floor(Math.log2(MAX_VALUE / Math.max(peak, 1e-12)))));
}

export const roundedCurveValue = (value: number, bits: number): number =>
  Math.max(-MAX_VALUE, Math.min(MAX_VALUE, Math.round(value * 2 ** bits))) / 2 ** bits;

/** Codes the curves of an attribute. A decoder fills `curves`. @param bits For a decoder, undefined. */
export function codeCurves(
  coder: BitCoder,
  part: AnimatedAttribute,
  frames: number,
  bits: CurveBits | undefined,
): void {
  const { rank, curves } = part;
  const numbers = new NumberModel();
  for (let k = 0; k < rank; k++) {
    const own = Math.min(MAX_BITS, coder.plain(bits?.[k] ?? 0, BITS));
    const unit = 2 ** own;
    let [before, twice, rest] = [0, 0, 0];
    for (let f = 0; f < frames; f++) {
      const expected = f < 2 ? before : 2 * before - twice;
      const given = Math.round(curves[rank * f + k] * unit) - expected;
      const sign = Math.sign(rest);
      rest = numbers.code(coder, given, 2 * Math.abs(rest), 0, 4 + sign);
      const value = Math.max(-MAX_VALUE, Math.min(MAX_VALUE, expected + rest));
      curves[rank * f + k] = value / unit;
      twice = before;
      before = value;
    }
  }
}
