import { halfToNumber } from '@gaussian-splat/core';
import type { AttributeSlice } from '@gaussian-splat/core/contract';

/** A range of an output, from the same run on the GPU (`found`) and on the CPU (`expected`). */
export interface OutputDifference {
  /** Name of the output. */
  readonly tensor: string;
  readonly dtype: 'float32' | 'float16' | 'int32';
  /** Offset of the range in the output, in elements. */
  readonly start: number;
  readonly found: Uint8Array;
  readonly expected: Uint8Array;
}

export interface Comparison {
  /** Largest difference of an attribute's numbers, as a fraction of the attribute's largest value. */
  readonly error: number;
  /** Name of the attribute or tensor with this difference. */
  readonly where: string;
  /** Fraction of the attribute's numbers, 0..1, whose difference exceeds the tolerance. */
  readonly share: number;
}

/**
 * Maximum error by element type, as a fraction of the largest value. Kernels round differently, and SwiftShader's sines
 * are accurate to 2e-4.
 */
export const ALLOWED = { float32: 1e-3, float16: 8e-3, int32: 0 } as const;
/** Fraction of numbers that may exceed the tolerance, because rounding may move a row across a threshold. */
export const ALLOWED_SHARE = 1e-3;

/** Whether two results differ by more than rounding. */
export const isDifferent = ({ share }: Comparison): boolean => share > ALLOWED_SHARE;

/**
 * Compares ranges of a run's output with the expected ones. Each attribute is compared on its own, because a small
 * attribute such as a covariance must be accurate, too.
 * @param attributes Location of the Gaussians in the outputs; empty for an image.
 * @returns The comparison of the attribute with the largest {@link Comparison.share}; among equal shares, that with the
 * largest error.
 */
export function compareOutputs(
  parts: readonly OutputDifference[],
  attributes: readonly AttributeSlice[] = [],
): Comparison {
  const comparisons = [...new Set(parts.map(({ tensor }) => tensor))].flatMap((tensor) => {
    const own = parts.filter((part) => part.tensor === tensor);
    const slices = attributes.filter((slice) => slice.tensor === tensor);
    if (slices.length === 0) return [compareAttribute(tensor, own, undefined)];
    return slices.map((slice) => compareAttribute(slice.attribute, own, slice));
  });
  const worst = comparisons.sort((a, b) => b.share - a.share || b.error - a.error)[0];
  return worst ?? { error: 0, where: 'nothing', share: 0 };
}

function compareAttribute(
  where: string,
  parts: readonly OutputDifference[],
  slice: AttributeSlice | undefined,
): Comparison {
  const pairs = parts.flatMap((part) => pairsOf(part, slice));
  const finite = pairs.map(([, expected]) => Math.abs(expected)).filter(Number.isFinite);
  const isAbsolute = slice?.activation === 'logit' || slice?.activation === 'log';
  const scale = isAbsolute ? 1 : finite.reduce((max, value) => Math.max(max, value), 0) || 1;
  const allowed = ALLOWED[parts[0]?.dtype ?? 'float32'];
  let error = 0;
  let beyond = 0;
  for (const [found, expected] of pairs) {
    const difference = differenceOf(found, expected) / scale;
    error = Math.max(error, difference);
    if (difference > allowed) beyond++;
  }
  return { error, where, share: pairs.length > 0 ? beyond / pairs.length : 0 };
}

function differenceOf(found: number, expected: number): number {
  if (Object.is(found, expected)) return 0;
  const difference = Math.abs(found - expected);
  return Number.isNaN(difference) ? Infinity : difference;
}

const sigmoid = (logit: number): number => 1 / (1 + Math.exp(-logit));

/** Returns pairs [found, expected] of an attribute's numbers in a range; of all numbers without an attribute. */
function pairsOf(
  { dtype, start, found, expected }: OutputDifference,
  slice: AttributeSlice | undefined,
): [number, number][] {
  const [a, b] = [numbersOf(found, dtype), numbersOf(expected, dtype)];
  const pairs: [number, number][] = [];
  for (let i = 0; i < Math.min(a.length, b.length); i++) {
    if (slice !== undefined) {
      const column = (start + i) % slice.rowStride;
      if (column < slice.offset || column >= slice.offset + slice.components) continue;
    }
    // Logits are compared as opacities, because a logit of 20 and one of 30 give the same opacity.
    pairs.push(slice?.activation === 'logit' ? [sigmoid(a[i]), sigmoid(b[i])] : [a[i], b[i]]);
  }
  return pairs;
}

function numbersOf(bytes: Uint8Array, dtype: OutputDifference['dtype']): ArrayLike<number> {
  const { buffer, byteOffset, byteLength } = (
    bytes.byteOffset % 4 === 0 ? bytes : bytes.slice()
  ) as Uint8Array<ArrayBuffer>;
  if (dtype === 'float16') return Array.from(new Uint16Array(buffer, byteOffset, byteLength >> 1), halfToNumber);
  const Numbers = dtype === 'int32' ? Int32Array : Float32Array;
  return new Numbers(buffer, byteOffset, byteLength >> 2);
}
