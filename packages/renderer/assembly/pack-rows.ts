// Packs splats to the words of PackedGaussian, and sorts packed splats. Addresses are those of memory that the caller
// has laid out: see row-packer.ts of the renderer.

import { exp2 } from '../../core/assembly/exp';
import { codeAlong, halfBits, log, scaleCode } from './shared';

export { begin, count, move } from './shared';

/** The `count` highest bits of a float32, rounded to nearest; `shift` = 32 - count. */
@inline
function highBits(value: f64, shift: u32): u32 {
  return (reinterpret<u32>(<f32>value) + (1 << (shift - 1))) >>> shift;
}

// Settings of the scene: see `setup`.
let steps: usize = 0;
let offsets: usize = 0;
let isActivated: i32 = 0;
let degree: i32 = 0;
let isHalf: i32 = 0;
let isMoved: i32 = 0;
let numbers: usize = 0;
let tables: usize = 0;
let scratch: usize = 0;
let firstVisible: u32 = 0;
let isContiguous: i32 = 0;

/**
 * @param stepsAt [5] u32 bytes from one splat to the next: of positions, scales, rotations, opacities, harmonics.
 * @param offsetsAt [59] u32 bytes from the address of these five: x, y, z, scales, rotations, opacity, constant color, then
 * [channel][15] harmonics.
 * @param activated Whether scales and opacities are linear, and rotations have unit length.
 * @param numbersAt [3] f64 subtracted from positions. @param tablesAt [256] f64 noise, [256] f64 factor of codes, [256]
 * i32 largest bits. @param scratchAt [48] u32, zero.
 */
export function setup(
  stepsAt: usize,
  offsetsAt: usize,
  shDegree: i32,
  half: i32,
  moved: i32,
  activated: i32,
  numbersAt: usize,
  tablesAt: usize,
  scratchAt: usize,
  visible: u32,
): void {
  steps = stepsAt;
  offsets = offsetsAt;
  degree = shDegree;
  isHalf = half;
  isMoved = moved;
  isActivated = activated;
  numbers = numbersAt;
  tables = tablesAt;
  scratch = scratchAt;
  firstVisible = visible;
  isContiguous = degree == 3 ? 1 : 0;
  for (let channel = 0; channel < 3; channel++)
    for (let k = 0; k < 15 && isContiguous; k++)
      if (restOffset(channel, k) != restOffset(channel, 0) + 4 * k) isContiguous = 0;
}

@inline
function restOffset(channel: i32, k: i32): u32 {
  return load<u32>(offsets + 4 * (14 + 15 * channel + k));
}

@inline
function at(row: usize, field: i32): f32 {
  return load<f32>(row + load<u32>(offsets + 4 * field));
}

/**
 * Low bytes of the nearest integers, halves up, of four numbers times their factors: the low bits of x + 1.5 2^52 are the
 * nearest integer of x.
 */
@inline
function codesOf(values: v128, low: v128, high: v128): v128 {
  const bias = f64x2.splat(9.313225746154785e-10);
  const magic = f64x2.splat(6755399441055744.0);
  const rest = i8x16.shuffle(values, values, 8, 9, 10, 11, 12, 13, 14, 15, 8, 9, 10, 11, 12, 13, 14, 15);
  const a = f64x2.add(f64x2.add(f64x2.mul(f64x2.promote_low_f32x4(values), low), bias), magic);
  const b = f64x2.add(f64x2.add(f64x2.mul(f64x2.promote_low_f32x4(rest), high), bias), magic);
  return v128.and(i8x16.shuffle(a, b, 0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19, 24, 25, 26, 27), i32x4.splat(255));
}

/**
 * Packs splats; unusable ones are left out.
 * @param positions Address of the first position, and so on. @param out Words of splats: 8 of geometry, then harmonics;
 * `stride` bytes each. @param reaches One float32 each. @param noises The same.
 * @returns Number of packed splats.
 */
export function pack(
  positions: usize,
  scales: usize,
  rotations: usize,
  opacities: usize,
  harmonics: usize,
  count: u32,
  out: usize,
  stride: u32,
  reaches: usize,
  noises: usize,
): u32 {
  const magnitude = i32x4.splat(0x7fffffff);
  const exponents = i32x4.splat(0x7f800000);
  const ps = load<u32>(steps);
  const ss = load<u32>(steps, 4);
  const rs = load<u32>(steps, 8);
  const os = load<u32>(steps, 12);
  const hs = load<u32>(steps, 16);
  let kept: u32 = 0;
  let to = out;
  for (let i: u32 = 0; i < count; i++) {
    const place = positions + <usize>i * ps;
    const size = scales + <usize>i * ss;
    const turn = rotations + <usize>i * rs;
    const row = harmonics + <usize>i * hs;
    // Opacity and scales.
    const logit = at(opacities + <usize>i * os, 10);
    let opacity = logit;
    let sx = <f64>at(size, 3);
    let sy = <f64>at(size, 4);
    let sz = <f64>at(size, 5);
    if (isActivated) {
      if (!(abs<f32>(logit) < Infinity)) continue;
      if (!(sx >= 0 && sy >= 0 && sz >= 0)) continue;
      opacity = max<f32>(0, min<f32>(1, logit));
    } else {
      if (logit != logit) continue;
      if (!(sx <= 200 && sy <= 200 && sz <= 200)) continue;
      const powers = exp2(f64x2.replace_lane(f64x2.splat(sx), 1, sy));
      const rest = exp2(f64x2.replace_lane(f64x2.splat(sz), 1, -<f64>logit));
      opacity = <f32>(1.0 / (1.0 + f64x2.extract_lane(rest, 1)));
      sx = <f64>(<f32>f64x2.extract_lane(powers, 0));
      sy = <f64>(<f32>f64x2.extract_lane(powers, 1));
      sz = <f64>(<f32>f64x2.extract_lane(rest, 0));
    }
    const longest = max<f64>(sx, max<f64>(sy, sz));
    if (!(longest >= 1e-12 && longest <= 1e12)) continue;
    // Position.
    let x = at(place, 0);
    let y = at(place, 1);
    let z = at(place, 2);
    if (!(abs<f32>(x) <= <f32>1e18 && abs<f32>(y) <= <f32>1e18 && abs<f32>(z) <= <f32>1e18)) continue;
    if (isMoved) {
      x = <f32>(<f64>x - load<f64>(numbers));
      y = <f32>(<f64>y - load<f64>(numbers + 8));
      z = <f32>(<f64>z - load<f64>(numbers + 16));
      if (!(abs<f32>(x) <= <f32>1e18 && abs<f32>(y) <= <f32>1e18 && abs<f32>(z) <= <f32>1e18)) continue;
    }
    // Rotation.
    let rw = at(turn, 6);
    let rx = at(turn, 7);
    let ry = at(turn, 8);
    let rz = at(turn, 9);
    const norm = <f64>rw * <f64>rw + <f64>rx * <f64>rx + <f64>ry * <f64>ry + <f64>rz * <f64>rz;
    if (!(norm > 0 && norm < Infinity)) continue;
    // Constant color.
    const red = at(row, 11);
    const green = at(row, 12);
    const blue = at(row, 13);
    const sum = <f64>red + <f64>green + <f64>blue;
    if (!(abs<f64>(sum) < Infinity)) continue;
    // Harmonics, planar: three channels of 16. The last one is zero.
    let noise: f64 = 0;
    const sh = to + 32;
    if (degree > 0) {
      let p0 = scratch;
      let p1 = scratch + 64;
      let p2 = scratch + 128;
      if (isContiguous) {
        p0 = row + restOffset(0, 0);
        p1 = row + restOffset(1, 0);
        p2 = row + restOffset(2, 0);
      } else {
        const terms = degree == 1 ? 3 : degree == 2 ? 8 : 15;
        for (let k = 0; k < terms; k++) {
          store<u32>(p0 + 4 * k, load<u32>(row + restOffset(0, k)));
          store<u32>(p1 + 4 * k, load<u32>(row + restOffset(1, k)));
          store<u32>(p2 + 4 * k, load<u32>(row + restOffset(2, k)));
        }
      }
      const r0 = v128.load(p0);
      const r1 = v128.load(p0, 16);
      const r2 = v128.load(p0, 32);
      const r3 = i32x4.replace_lane(v128.load(p0, 48), 3, 0);
      const g0 = v128.load(p1);
      const g1 = v128.load(p1, 16);
      const g2 = v128.load(p1, 32);
      const g3 = i32x4.replace_lane(v128.load(p1, 48), 3, 0);
      const b0 = v128.load(p2);
      const b1 = v128.load(p2, 16);
      const b2 = v128.load(p2, 32);
      const b3 = i32x4.replace_lane(v128.load(p2, 48), 3, 0);
      const m0 = i32x4.max_s(
        i32x4.max_s(v128.and(r0, magnitude), v128.and(g0, magnitude)),
        v128.and(b0, magnitude),
      );
      const m1 = i32x4.max_s(
        i32x4.max_s(v128.and(r1, magnitude), v128.and(g1, magnitude)),
        v128.and(b1, magnitude),
      );
      const m2 = i32x4.max_s(
        i32x4.max_s(v128.and(r2, magnitude), v128.and(g2, magnitude)),
        v128.and(b2, magnitude),
      );
      const m3 = i32x4.max_s(
        i32x4.max_s(v128.and(r3, magnitude), v128.and(g3, magnitude)),
        v128.and(b3, magnitude),
      );
      const top = i32x4.max_s(i32x4.max_s(m0, m1), i32x4.max_s(m2, m3));
      if (v128.any_true(i32x4.ge_s(top, exponents))) continue;
      const first1 = max<i32>(
        i32x4.extract_lane(m0, 0),
        max<i32>(i32x4.extract_lane(m0, 1), i32x4.extract_lane(m0, 2)),
      );
      const pair = i32x4.max_s(m1, i64x2.shuffle(m1, m1, 1, 0));
      const first2 = max<i32>(
        i32x4.extract_lane(m0, 3),
        max<i32>(i32x4.extract_lane(pair, 0), i32x4.extract_lane(pair, 1)),
      );
      const last = i32x4.max_s(m2, m3);
      const ends = i32x4.max_s(last, i64x2.shuffle(last, last, 1, 0));
      const first3 = max<i32>(i32x4.extract_lane(ends, 0), i32x4.extract_lane(ends, 1));
      const c1 = scaleCode(first1, tables + 4096);
      const c2 = degree > 1 ? scaleCode(first2, tables + 4096) : 0;
      const c3 = degree > 2 ? scaleCode(first3, tables + 4096) : 0;
      noise = 3 * load<f64>(tables + 8 * c1);
      if (degree > 1) noise += 5 * load<f64>(tables + 8 * c2);
      if (degree > 2) noise += 7 * load<f64>(tables + 8 * c3);
      if (!isHalf) {
        const u1 = load<f64>(tables + 2048 + 8 * c1);
        const u2 = load<f64>(tables + 2048 + 8 * c2);
        const u3 = load<f64>(tables + 2048 + 8 * c3);
        const s1 = f64x2.splat(u1);
        const s12 = f64x2.replace_lane(s1, 1, u2);
        const s2 = f64x2.splat(u2);
        const s3 = f64x2.splat(u3);
        const R = i8x16.narrow_i16x8_u(
          i16x8.narrow_i32x4_u(codesOf(r0, s1, s12), codesOf(r1, s2, s2)),
          i16x8.narrow_i32x4_u(codesOf(r2, s3, s3), codesOf(r3, s3, s3)),
        );
        const G = i8x16.narrow_i16x8_u(
          i16x8.narrow_i32x4_u(codesOf(g0, s1, s12), codesOf(g1, s2, s2)),
          i16x8.narrow_i32x4_u(codesOf(g2, s3, s3), codesOf(g3, s3, s3)),
        );
        const B = i8x16.narrow_i16x8_u(
          i16x8.narrow_i32x4_u(codesOf(b0, s1, s12), codesOf(b1, s2, s2)),
          i16x8.narrow_i32x4_u(codesOf(b2, s3, s3), codesOf(b3, s3, s3)),
        );
        // Interleaves three rows of 15 bytes.
        const rg0 = i8x16.shuffle(R, G, 0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5);
        const o0 = i8x16.shuffle(rg0, B, 0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15);
        const rg1 = i8x16.shuffle(R, G, 21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26);
        const o1 = i8x16.shuffle(rg1, B, 0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15);
        const rg2 = i8x16.shuffle(R, G, 0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0);
        const o2 = i8x16.shuffle(rg2, B, 26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31);
        if (degree == 3) {
          v128.store(sh, o0, 8);
          v128.store(sh, o1, 24);
          v128.store(sh, o2, 40);
          store<u8>(sh, <u8>c3, 53);
          store<u16>(sh, 0, 54);
          store<u8>(sh, <u8>c2, 7);
        } else if (degree == 2) {
          v128.store(sh, o0, 8);
          v128.store64_lane(sh, o1, 0, 24);
          store<u8>(sh, <u8>c2, 7);
        } else {
          v128.store64_lane(sh, o0, 0, 8);
          store<u8>(sh, <u8>i8x16.extract_lane_u(o0, 8), 7);
        }
        store<u8>(sh, <u8>c1, 6);
      } else {
        const terms = degree == 1 ? 3 : degree == 2 ? 8 : 15;
        let word = sh + 6;
        for (let k = 0; k < terms; k++, word += 6) {
          store<u16>(word, <u16>halfBits(load<f32>(p0 + 4 * k)));
          store<u16>(word, <u16>halfBits(load<f32>(p1 + 4 * k)), 2);
          store<u16>(word, <u16>halfBits(load<f32>(p2 + 4 * k)), 4);
        }
      }
    } else {
      store<u16>(sh, 0, 6);
    }
    store<u16>(sh, <u16>halfBits(red));
    store<u16>(sh, <u16>halfBits(green), 2);
    store<u16>(sh, <u16>halfBits(blue), 4);
    // Factor of the covariance: see `scaleRotationFactor`.
    if (!isActivated) {
      const unit0 = 1 / sqrt<f64>(norm);
      rw = <f32>(<f64>rw * unit0);
      rx = <f32>(<f64>rx * unit0);
      ry = <f32>(<f64>ry * unit0);
      rz = <f32>(<f64>rz * unit0);
    }
    const most = <f64>max<f32>(max<f32>(abs<f32>(rw), abs<f32>(rx)), max<f32>(abs<f32>(ry), abs<f32>(rz)));
    let qw = <f64>rw / most;
    let qx = <f64>rx / most;
    let qy = <f64>ry / most;
    let qz = <f64>rz / most;
    const unit = 1 / sqrt<f64>(qw * qw + qx * qx + qy * qy + qz * qz);
    qw *= unit;
    qx *= unit;
    qy *= unit;
    qz *= unit;
    const ax = (1 - 2 * (qy * qy + qz * qz)) * sx;
    const ay = 2 * (qx * qy - qw * qz) * sy;
    const az = 2 * (qx * qz + qw * qy) * sz;
    let bx = 2 * (qx * qy + qw * qz) * sx;
    let by = (1 - 2 * (qx * qx + qz * qz)) * sy;
    let bz = 2 * (qy * qz - qw * qx) * sz;
    let cx = 2 * (qx * qz - qw * qy) * sx;
    let cy = 2 * (qy * qz + qw * qx) * sy;
    let cz = (1 - 2 * (qx * qx + qy * qy)) * sz;
    const xx = sqrt<f64>(ax * ax + ay * ay + az * az);
    const ix = xx > 0 ? 1 / xx : 0;
    const yx = (ax * bx + ay * by + az * bz) * ix;
    const zx = (ax * cx + ay * cy + az * cz) * ix;
    bx = bx - yx * ax * ix;
    by = by - yx * ay * ix;
    bz = bz - yx * az * ix;
    cx = cx - zx * ax * ix;
    cy = cy - zx * ay * ix;
    cz = cz - zx * az * ix;
    const yy = sqrt<f64>(bx * bx + by * by + bz * bz);
    const iy = yy > 0 ? 1 / yy : 0;
    const zy = (bx * cx + by * cy + bz * cz) * iy;
    cx = cx - zy * bx * iy;
    cy = cy - zy * by * iy;
    cz = cz - zy * bz * iy;
    const zz = sqrt<f64>(cx * cx + cy * cy + cz * cz);
    const lastBits = highBits(zz, 10);
    let visible = highBits(<f64>opacity, 4);
    visible = <f64>opacity >= 0.00392156862745098 ? max<u32>(visible, firstVisible) : min<u32>(visible, firstVisible - 1);
    store<f32>(to, x);
    store<f32>(to, y, 4);
    store<f32>(to, z, 8);
    store<u32>(to, (highBits(xx, 10) << 10) | (lastBits >>> 12), 12);
    store<u32>(to, (highBits(yx, 10) << 10) | ((lastBits >>> 2) & 0x3ff), 16);
    store<u32>(to, (highBits(yy, 10) << 10) | ((lastBits & 3) << 8) | (visible >>> 20), 20);
    store<u32>(to, (highBits(zx, 10) << 10) | ((visible >>> 10) & 0x3ff), 24);
    store<u32>(to, (highBits(zy, 10) << 10) | (visible & 0x3ff), 28);
    // Facts.
    store<f32>(
      reaches + 4 * <usize>kept,
      <f32>(longest * sqrt<f64>(2 * log(max<f64>(1, <f64>opacity / 0.00392156862745098)))),
    );
    store<f32>(noises + 4 * <usize>kept, <f32>noise);
    kept++;
    to += stride;
  }
  return kept;
}

/** Writes the codes of splats `first` to `end` along the curve. @param axes Medians, and twice the spreads. */
export function encode(words: usize, stride: u32, first: u32, end: u32, codes: usize, axes: usize): void {
  let at = words + <usize>first * stride;
  for (let i: u32 = first; i < end; i++, at += stride) store<u32>(codes + 4 * <usize>i, codeAlong(at, axes));
}

/** Writes the splats `first` to `end` of an order: geometry, harmonics, and grows the bounds of their chunks. */
export function gather(
  order: usize,
  first: u32,
  end: u32,
  words: usize,
  stride: u32,
  reaches: usize,
  geometry: usize,
  sh: usize,
  chunks: usize,
): void {
  const shBytes = stride - 32;
  let g = geometry;
  let s = sh;
  for (let k = first; k < end; k++, g += 32, s += shBytes) {
    const i: usize = order ? <usize>load<u32>(order + 8 * <usize>k, 4) : <usize>k;
    const from = words + i * stride;
    const head = v128.load(from);
    v128.store(g, head);
    v128.store(g, v128.load(from, 16), 16);
    for (let b: u32 = 0; b < shBytes; b += 8) store<u64>(s + b, load<u64>(from + 32 + b));
    const chunk = chunks + 32 * <usize>((k - first) >>> 8);
    const p = f32x4.replace_lane(head, 3, load<f32>(reaches + 4 * i));
    if (((k - first) & 255) == 0) {
      v128.store(chunk, p);
      v128.store(chunk, f32x4.replace_lane(head, 3, 0), 16);
    } else {
      const low = v128.load(chunk);
      const reach = max<f32>(f32x4.extract_lane(low, 3), f32x4.extract_lane(p, 3));
      v128.store(chunk, f32x4.replace_lane(f32x4.pmin(low, p), 3, reach));
      v128.store(chunk, f32x4.replace_lane(f32x4.pmax(v128.load(chunk, 16), p), 3, 0), 16);
    }
  }
}
