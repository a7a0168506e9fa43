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
  const sign = (bits[0] >>> 16) & 0x8000;
  const magnitude = Math.abs(float[0]);
  if (Number.isNaN(magnitude)) return sign | 0x7e00;
  if (magnitude >= 65_520) return sign | 0x7c00;
  const exponent = Math.max(-14, Math.floor(Math.log2(magnitude || 2 ** -24)));
  const scaled = magnitude / 2 ** (exponent - 10);
  const floor = Math.floor(scaled);
  const isUp = scaled - floor > 0.5 || (scaled - floor === 0.5 && floor % 2 === 1);
  // A fraction that rounds up to 2048 carries into the exponent.
  return sign + (exponent + 14) * 1024 + floor + (isUp ? 1 : 0);
}
