/** Values of all 65,536 float16 bit patterns; undefined before the first use. */
let table: Float32Array | undefined;

/** Returns the value of the 16 bits of an IEEE 754 binary16. */
export function halfToNumber(bits: number): number {
  table ??= Float32Array.from({ length: 65_536 }, (_, pattern) => decode(pattern));
  return table[bits];
}

function decode(bits: number): number {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return exponent === 0 ? sign * fraction * 2 ** -24 : sign * (1024 + fraction) * 2 ** (exponent - 25);
}

const float = new Float32Array(1);
const bits = new Uint32Array(float.buffer);

/** Returns the bits of the float16 nearest to a number, ties to even. Numbers beyond its range become infinity. */
export function numberToHalf(value: number): number {
  float[0] = value;
  const b = bits[0];
  const sign = (b >>> 16) & 0x8000;
  const exponent = (b >>> 23) & 0xff;
  const mantissa = b & 0x7fffff;
  if (exponent === 255 && mantissa > 0) return sign | 0x7e00;
  // Normal number: rounding up may carry into the exponent, which gives the correct result.
  if (exponent > 112) return sign | Math.min(0x7c00, roundedShift(((exponent - 112) << 23) | mantissa, 13));
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
