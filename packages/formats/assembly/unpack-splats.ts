// Unpacks splats of a compressed PLY, to the numbers of compressed-ply.ts. Addresses are those of memory that the caller
// has laid out: see unpack-splats.ts of formats.
import { exp2 } from '../../core/assembly/exp';

const SH_C0: f64 = 0.28209479177387814, SQRT2: f64 = 1.4142135623730951;

@inline
function mix(low: v128, high: v128, t: v128): v128 {
  return f64x2.add(f64x2.mul(low, f64x2.sub(f64x2.splat(1), t)), f64x2.mul(high, t));
}

@inline
function pair(at: usize): v128 {
  return f64x2.promote_low_f32x4(v128.load64_zero(at));
}

@inline
function single(at: usize): v128 {
  return f64x2.splat(<f64>load<f32>(at));
}

/** Two integers divided by their largest values. */
@inline
function parts(a: u32, b: u32, most: v128): v128 {
  return f64x2.div(f64x2.convert_low_i32x4_u(i32x4.replace_lane(i32x4.splat(a), 1, b)), most);
}

/** Three numbers of 11, 10 and 11 bits between bounds. */
@inline
function unpack111011(word: u32, low: usize, high: usize, to: usize): void {
  const most = f64x2.replace_lane(f64x2.splat(2047), 1, 1023);
  const xy = mix(pair(low), pair(high), parts(word >>> 21, (word >>> 11) & 1023, most));
  const z = mix(single(low + 8), single(high + 8), f64x2.splat(<f64>(word & 2047) / 2047));
  v128.store64_lane(to, f32x4.demote_f64x2_zero(xy), 0);
  store<f32>(to, <f32>f64x2.extract_lane(z, 0), 8);
}

/**
 * Unpacks splats from the first of a chunk on.
 * @param words Four u32 each. @param bounds [18] f32 of each 256 splats. @param stride Bytes of the harmonics of a splat.
 */
export function unpack(
  words: usize,
  bounds: usize,
  count: u32,
  positions: usize,
  scales: usize,
  rotations: usize,
  opacities: usize,
  sh: usize,
  stride: u32,
): void {
  const bytes = f64x2.splat(255);
  const half = f64x2.splat(0.5);
  for (let i: usize = 0; i < <usize>count; i++) {
    const chunk = bounds + 72 * (i >>> 8);
    const from = words + 16 * i;
    unpack111011(load<u32>(from), chunk, chunk + 12, positions + 12 * i);
    unpack111011(load<u32>(from, 8), chunk + 24, chunk + 36, scales + 12 * i);
    const turn = load<u32>(from, 4);
    const largest = turn >>> 30;
    let squares: f64 = 0;
    let rest = turn;
    for (let component: i32 = 3; component >= 0; component--) {
      if (component == largest) continue;
      const value = (<f64>(rest & 1023) / 1023 - 0.5) * SQRT2;
      store<f32>(rotations + 16 * i + 4 * component, <f32>value);
      squares += value * value;
      rest >>>= 10;
    }
    store<f32>(rotations + 16 * i + 4 * largest, <f32>sqrt<f64>(max<f64>(0, 1 - squares)));
    const color = load<u32>(from, 12);
    const rg = mix(pair(chunk + 48), pair(chunk + 60), parts(color >>> 24, (color >>> 16) & 255, bytes));
    const ba = parts((color >>> 8) & 255, color & 255, bytes);
    const b = mix(single(chunk + 56), single(chunk + 68), ba);
    const to = sh + stride * i;
    v128.store64_lane(to, f32x4.demote_f64x2_zero(f64x2.div(f64x2.sub(rg, half), f64x2.splat(SH_C0))), 0);
    store<f32>(to, <f32>((f64x2.extract_lane(b, 0) - 0.5) / SH_C0), 8);
    store<f32>(opacities + 4 * i, <f32>f64x2.extract_lane(ba, 1));
  }
  for (let at = scales; at < scales + 12 * <usize>count; at += 8)
    v128.store64_lane(at, f32x4.demote_f64x2_zero(exp2(pair(at))), 0);
}

/**
 * Unpacks the harmonics above the constant one.
 * @param rows `stored` bytes of each channel. @param terms Those that are kept. @param table [256] f32 of each byte.
 */
export function harmonics(rows: usize, count: u32, stored: u32, terms: u32, table: usize, sh: usize): void {
  let to = sh;
  let row = rows;
  for (let i: u32 = 0; i < count; i++, row += 3 * stored) {
    to += 12;
    for (let k: usize = 0; k < <usize>terms; k++)
      for (let channel: usize = 0; channel < 3; channel++, to += 4)
        store<f32>(to, load<f32>(table + 4 * <usize>load<u8>(row + channel * stored + k)));
  }
}
