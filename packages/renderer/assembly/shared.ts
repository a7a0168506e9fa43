// Functions that the modules of this folder share: logarithms, float16, codes along a curve, and a radix sort.

import { LOG_HIGH, LOG_LOW } from '../../core/assembly/exp';

/** log of fdlibm for finite numbers of at least 1. */
export function log(given: f64): f64 {
  const bits = reinterpret<u64>(given);
  let hx: i32 = <i32>(bits >> 32);
  let k: i32 = (hx >> 20) - 1023;
  hx &= 0x000fffff;
  let i = (hx + 0x95f64) & 0x100000;
  const x = reinterpret<f64>((<u64>(hx | (i ^ 0x3ff00000)) << 32) | (bits & 0xffffffff));
  k += i >> 20;
  const f = x - 1.0;
  const dk = <f64>k;
  if ((0x000fffff & (2 + hx)) < 3) {
    if (f == 0) return k == 0 ? 0 : dk * LOG_HIGH + dk * LOG_LOW;
    const R = f * f * (0.5 - 0.33333333333333333 * f);
    return k == 0 ? f - R : dk * LOG_HIGH - (R - dk * LOG_LOW - f);
  }
  const s = f / (2.0 + f);
  const z = s * s;
  i = hx - 0x6147a;
  const w = z * z;
  const j = 0x6b851 - hx;
  const t1 = w * (3.999999999940941908e-1 + w * (2.222219843214978396e-1 + w * 1.531383769920937332e-1));
  const t2 =
    z *
    (6.666666666666735130e-1 +
      w * (2.857142874366239149e-1 + w * (1.818357216161805012e-1 + w * 1.479819860511658591e-1)));
  i |= j;
  const R = t2 + t1;
  if (i > 0) {
    const hfsq = 0.5 * f * f;
    return k == 0 ? f - (hfsq - s * (hfsq + R)) : dk * LOG_HIGH - (hfsq - (s * (hfsq + R) + dk * LOG_LOW) - f);
  }
  return k == 0 ? f - s * (f - R) : dk * LOG_HIGH - (s * (f - R) - dk * LOG_LOW - f);
}

@inline
export function roundedShift(value: u32, shift: u32): u32 {
  const down = value >>> shift;
  const rest = value & ((1 << shift) - 1);
  const half: u32 = 1 << (shift - 1);
  return rest > half || (rest == half && (down & 1) == 1) ? down + 1 : down;
}

export function halfBits(value: f32): u32 {
  const b = reinterpret<u32>(min<f32>(65504, max<f32>(-65504, value)));
  const sign = (b >>> 16) & 0x8000;
  const exponent = (b >>> 23) & 0xff;
  const mantissa = b & 0x7fffff;
  if (exponent > 112) return sign | roundedShift(((exponent - 112) << 23) | mantissa, 13);
  if (exponent < 102) return sign;
  return sign | roundedShift(mantissa | 0x800000, 126 - exponent);
}

@inline
export function spreadBits(cell: u32): u32 {
  let x = cell & 0x7ff;
  x = (x | (x << 16)) & 0x070000ff;
  x = (x | (x << 8)) & 0x0700f00f;
  x = (x | (x << 4)) & 0x430c30c3;
  return (x | (x << 2)) & 0x49249249;
}

/** Cells of two coordinates along their axes. */
@inline
export function cellsOf(positions: v128, medians: v128, twice: v128, steps: v128): v128 {
  const x = f64x2.div(f64x2.sub(positions, medians), twice);
  const size = f32x4.demote_f64x2_zero(f64x2.add(f64x2.abs(x), f64x2.sqrt(f64x2.add(f64x2.mul(x, x), f64x2.splat(1)))));
  const along = f64x2.mul(
    f64x2.div(f64x2.sub(f64x2.convert_low_i32x4_u(size), f64x2.splat(1065353216.0)), f64x2.splat(8388608.0)),
    f64x2.splat(0.6931471805599453),
  );
  const signed = v128.bitselect(f64x2.neg(along), along, f64x2.lt(x, f64x2.splat(0)));
  const cell = f64x2.floor(
    f64x2.mul(f64x2.mul(f64x2.add(f64x2.mul(signed, f64x2.splat(0.25)), f64x2.splat(1)), f64x2.splat(0.5)), steps),
  );
  const most = f64x2.sub(steps, f64x2.splat(1));
  return i32x4.trunc_sat_f64x2_u_zero(f64x2.min(most, f64x2.max(f64x2.splat(0), cell)));
}

/** Code of the scale of a band. @param largest Bits of its largest magnitude. @param maxBits [256] i32 largest bits. */
@inline
export function scaleCode(largest: i32, maxBits: usize): i32 {
  let code = (largest >>> 20) - 888;
  if (code < 0) code = 0;
  if (code > 255) return 255;
  while (code < 255 && largest > load<i32>(maxBits + 4 * code)) code++;
  return code;
}

/** Code along a curve of a position, three float32. @param axes [6] f64 medians, and twice the spreads. */
@inline
export function codeAlong(position: usize, axes: usize): u32 {
  const xy = f64x2.promote_low_f32x4(v128.load64_zero(position));
  const z = f64x2.splat(<f64>load<f32>(position, 8));
  const low = cellsOf(xy, v128.load(axes), v128.load(axes, 24), f64x2.splat(2048));
  const high = cellsOf(z, v128.load64_splat(axes, 16), v128.load64_splat(axes, 40), f64x2.splat(1024));
  return (
    spreadBits(i32x4.extract_lane(low, 0)) |
    (spreadBits(i32x4.extract_lane(low, 1)) << 1) |
    (spreadBits(i32x4.extract_lane(high, 0)) << 2)
  );
}

/** Adds the four digits of keys `first` to `end` to four tables of 256 numbers. */
export function count(keys: usize, first: u32, end: u32, tables: usize): void {
  for (let k: u32 = first; k < end; k++) {
    const key = load<u32>(keys + 4 * <usize>k);
    const a = tables + 4 * <usize>(key & 255);
    const b = tables + 1024 + 4 * <usize>((key >>> 8) & 255);
    const c = tables + 2048 + 4 * <usize>((key >>> 16) & 255);
    const d = tables + 3072 + 4 * <usize>(key >>> 24);
    store<u32>(a, load<u32>(a) + 1);
    store<u32>(b, load<u32>(b) + 1);
    store<u32>(c, load<u32>(c) + 1);
    store<u32>(d, load<u32>(d) + 1);
  }
}

/** Moves pairs of a key and an index in the order of one digit, stably. @param places Of the next pair of each digit. */
export function move(from: usize, to: usize, first: u32, end: u32, shift: u32, places: usize): void {
  for (let k: u32 = first; k < end; k++) {
    const pair = load<u64>(from + 8 * <usize>k);
    const place = places + 4 * <usize>((<u32>pair >>> shift) & 255);
    const at = load<u32>(place);
    store<u32>(place, at + 1);
    store<u64>(to + 8 * <usize>at, pair);
  }
}

/** The first pass of {@link move}, from keys without indices. */
export function begin(keys: usize, to: usize, first: u32, end: u32, places: usize): void {
  for (let k: u32 = first; k < end; k++) {
    const key = load<u32>(keys + 4 * <usize>k);
    const place = places + 4 * <usize>(key & 255);
    const at = load<u32>(place);
    store<u32>(place, at + 1);
    store<u64>(to + 8 * <usize>at, <u64>key | (<u64>k << 32));
  }
}
