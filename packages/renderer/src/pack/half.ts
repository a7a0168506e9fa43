const float = new Float32Array(1);
const bits = new Uint32Array(float.buffer);

// core/half.js rounds in the same way, but has infinity. An import of it would be one more script of every page.

/** Largest finite float16. */
const HALF_MAX = 65504;

/**
 * Returns the bits of the float16 nearest to a finite number, ties to even. Magnitudes above HALF_MAX become
 * ±HALF_MAX.
 */
export function halfBits(value: number): number {
  float[0] = Math.min(HALF_MAX, Math.max(-HALF_MAX, value));
  const b = bits[0];
  const sign = (b >>> 16) & 0x8000;
  const exponent = (b >>> 23) & 0xff;
  const mantissa = b & 0x7fffff;
  if (exponent > 112) {
    // Normal number: rounding up may carry into the exponent, which gives the correct result.
    return sign | roundedShift(((exponent - 112) << 23) | mantissa, 13);
  }
  if (exponent < 102) return sign;
  // Subnormal: the implicit leading one becomes explicit.
  return sign | roundedShift(mantissa | 0x800000, 126 - exponent);
}

/** Returns value / 2^shift, rounded to the nearest integer, ties to even. */
function roundedShift(value: number, shift: number): number {
  const floor = value >>> shift;
  const rest = value & ((1 << shift) - 1);
  const half = 1 << (shift - 1);
  return rest > half || (rest === half && (floor & 1) === 1) ? floor + 1 : floor;
}
