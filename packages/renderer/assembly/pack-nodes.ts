// Packs the splats of a node of a tree as quantized chunks, divides them among its children, and sorts them along a curve.
// The memory is laid out by node-packer.ts of the renderer, whose TypeScript version gives the same words.

import { begin, codeAlong, count as countDigits, halfBits, log, move, scaleCode } from './shared';

// Addresses of the arrays of a cloud, and its degree: see `setup`.
let positions: usize = 0;
let scales: usize = 0;
let rotations: usize = 0;
let opacities: usize = 0;
let harmonics: usize = 0;
let degree: i32 = 0;
let isHalf: i32 = 0;
let numbers: usize = 0;
let scratch: usize = 0;

/**
 * @param at [5] u32 addresses of positions, scales, rotations, opacities and harmonics, float32.
 * @param numbersAt f64: smallest visible opacity, its code, factor of opacities, steps of sizes, zero of the directions in 2 and
 * in 3 dimensions, octaves at most, steps of centers, factor of the reach; from byte 128 on [256] f64 factor of codes, [256] i32 largest bits.
 * @param scratchAt 12,288 bytes.
 */
export function setup(at: usize, shDegree: i32, half: i32, numbersAt: usize, scratchAt: usize): void {
  positions = load<u32>(at);
  scales = load<u32>(at, 4);
  rotations = load<u32>(at, 8);
  opacities = load<u32>(at, 12);
  harmonics = load<u32>(at, 16);
  degree = shDegree;
  isHalf = half;
  numbers = numbersAt;
  scratch = scratchAt;
}

/** Nearest integers, halves up, as Math.round. */
@inline
function rounded(x: v128): v128 {
  const down = f64x2.floor(x);
  return f64x2.add(down, v128.and(f64x2.ge(f64x2.sub(x, down), f64x2.splat(0.5)), f64x2.splat(1)));
}

/** Codes of two values in the lower lanes, 0 if the step is 0. */
@inline
function codesOf(values: v128, low: f64, step: f64, most: f64): v128 {
  const nearest = rounded(f64x2.div(f64x2.sub(values, f64x2.splat(low)), f64x2.splat(step)));
  const code = f64x2.min(f64x2.splat(most), f64x2.max(f64x2.splat(0), nearest));
  return step > 0 ? i32x4.trunc_sat_f64x2_u_zero(code) : i32x4.splat(0);
}

/** Codes of two directions: `zero` (1 + part / sum), or `zero` without a sum. */
@inline
function directions(part: v128, sum: v128, zero: f64): v128 {
  const steps = rounded(f64x2.div(f64x2.mul(f64x2.splat(zero), part), sum));
  return i32x4.trunc_sat_f64x2_u_zero(
    f64x2.add(f64x2.splat(zero), v128.and(steps, f64x2.gt(sum, f64x2.splat(0)))),
  );
}

/** 1 / x, or 0 for 0. */
@inline
function inverse(x: v128): v128 {
  return v128.and(f64x2.div(f64x2.splat(1), x), f64x2.gt(x, f64x2.splat(0)));
}

@inline
function square(x: v128): v128 {
  return f64x2.mul(x, x);
}

/** a b + c d + e f. */
@inline
function dot(a: v128, b: v128, c: v128, d: v128, e: v128, f: v128): v128 {
  return f64x2.add(f64x2.add(f64x2.mul(a, b), f64x2.mul(c, d)), f64x2.mul(e, f));
}

/** (1 - 2 (a² + b²)) s. */
@inline
function diagonal(a: v128, b: v128, s: v128): v128 {
  const sum = f64x2.add(square(a), square(b));
  return f64x2.mul(f64x2.sub(f64x2.splat(1), f64x2.mul(f64x2.splat(2), sum)), s);
}

/** Value - part · other · inverse. */
@inline
function without(value: v128, part: v128, other: v128, inverse: v128): v128 {
  return f64x2.sub(value, f64x2.mul(f64x2.mul(part, other), inverse));
}

/** Stores two numbers as float32, and returns these. */
@inline
function stored(values: v128, at: usize): v128 {
  const floats = f32x4.demote_f64x2_zero(values);
  v128.store64_lane(at, floats, 0);
  return f64x2.promote_low_f32x4(floats);
}

/** Smallest float32 that is at least the given non-negative number. */
@inline
function roundedUp(value: f64): f32 {
  const nearest = <f32>value;
  return <f64>nearest < value ? reinterpret<f32>(reinterpret<u32>(nearest) + 1) : nearest;
}

@inline
function next(w: v128, term: f64, rest: v128): v128 {
  return f64x2.mul(w, f64x2.add(f64x2.splat(term), rest));
}

/** log2 of fdlibm for two numbers that are not negative; -Infinity for those below the normal ones. */
@inline
function log2(x: v128): v128 {
  const upper = v128.and(i64x2.shr_u(x, 32), i64x2.splat(0x000fffff));
  const i = v128.and(i64x2.add(upper, i64x2.splat(0x95f64)), i64x2.splat(0x100000));
  const k = i64x2.add(i64x2.sub(i64x2.shr_u(x, 52), i64x2.splat(1023)), i64x2.shr_u(i, 20));
  const head = i64x2.shl(v128.or(upper, v128.xor(i, i64x2.splat(0x3ff00000))), 32);
  const y = f64x2.convert_low_i32x4_s(v128.shuffle<i32>(k, k, 0, 2, 0, 2));
  const f = f64x2.sub(v128.or(head, v128.and(x, i64x2.splat(0xffffffff))), f64x2.splat(1));
  const half = f64x2.mul(f64x2.mul(f64x2.splat(0.5), f), f);
  const s = f64x2.div(f, f64x2.add(f64x2.splat(2), f));
  const z = square(s);
  const w = square(z);
  const t1 = next(
    w,
    3.999999999940941908e-1,
    next(w, 2.222219843214978396e-1, f64x2.mul(w, f64x2.splat(1.531383769920937332e-1))),
  );
  const t2 = next(
    z,
    6.66666666666673513e-1,
    next(
      w,
      2.857142874366239149e-1,
      next(w, 1.818357216161805012e-1, f64x2.mul(w, f64x2.splat(1.479819860510658591e-1))),
    ),
  );
  const r = f64x2.mul(s, f64x2.add(half, f64x2.add(t2, t1)));
  const high = v128.and(f64x2.sub(f, half), i64x2.splat(0xffffffff00000000));
  const low = f64x2.add(f64x2.sub(f64x2.sub(f, high), half), r);
  const value = f64x2.mul(high, f64x2.splat(1.44269504072144627571));
  const sum = f64x2.add(y, value);
  const rest = f64x2.add(
    f64x2.mul(f64x2.add(low, high), f64x2.splat(1.67517131648865118353e-10)),
    f64x2.mul(low, f64x2.splat(1.44269504072144627571)),
  );
  const whole = f64x2.add(f64x2.add(rest, f64x2.add(f64x2.sub(y, sum), value)), sum);
  return v128.bitselect(whole, f64x2.splat(-Infinity), f64x2.ge(x, f64x2.splat(2.2250738585072014e-308)));
}

/** log2 of one number. */
function log2Of(x: f64): f64 {
  return f64x2.extract_lane(log2(f64x2.splat(x)), 0);
}

/**
 * Divides splats among boxes: each belongs to the nearest one, or to the first of those that contain it.
 * @param own [n] u32 splats. @param boxes [count, 15] f64 center, three unit vectors, three half lengths.
 * @param ids [count] u32 numbers of the boxes. @param counts u32, zero, of all numbers. @param owners [n] u32 result.
 */
export function divide(own: usize, n: u32, boxes: usize, ids: usize, count: u32, counts: usize, owners: usize): void {
  for (let k: u32 = 0; k < n; k++) {
    const p = positions + 12 * <usize>load<u32>(own + 4 * <usize>k);
    const x = <f64>load<f32>(p);
    const y = <f64>load<f32>(p, 4);
    const z = <f64>load<f32>(p, 8);
    let owner: u32 = 0;
    let nearest: f64 = Infinity;
    for (let b: u32 = 0; b < count; b++) {
      const box = boxes + 120 * <usize>b;
      const dx = x - load<f64>(box);
      const dy = y - load<f64>(box, 8);
      const dz = z - load<f64>(box, 16);
      let outside: f64 = 0;
      let inside: f64 = -Infinity;
      for (let axis: usize = 0; axis < 3; axis++) {
        const unit = box + 24 + 24 * axis;
        const along = dx * load<f64>(unit) + dy * load<f64>(unit, 8) + dz * load<f64>(unit, 16);
        const beyond = abs<f64>(along) - load<f64>(box + 96 + 8 * axis);
        if (beyond > 0) outside += beyond * beyond;
        if (beyond > inside) inside = beyond;
      }
      const distance = outside > 0 ? sqrt<f64>(outside) : inside;
      if (distance < nearest) {
        owner = load<u32>(ids + 4 * <usize>b);
        nearest = distance;
      }
    }
    const place = counts + 4 * <usize>owner;
    store<u32>(place, load<u32>(place) + 1);
    store<u32>(owners + 4 * <usize>k, owner);
  }
}

/**
 * Sorts splats along a curve. @param own [n] u32 splats, replaced by the result. @param axes See `codeAlong`.
 * @param work 20 n + 4,096 bytes.
 */
export function order(own: usize, n: u32, axes: usize, work: usize): void {
  const digits = work;
  const codes = digits + 4096;
  const a = codes + 4 * <usize>n;
  const b = a + 8 * <usize>n;
  memory.fill(digits, 0, 4096);
  for (let k: usize = 0; k < <usize>n; k++)
    store<u32>(codes + 4 * k, codeAlong(positions + 12 * <usize>load<u32>(own + 4 * k), axes));
  countDigits(codes, 0, n, digits);
  for (let pass: usize = 0; pass < 4; pass++) {
    let next: u32 = 0;
    for (let digit = digits + 1024 * pass; digit < digits + 1024 * (pass + 1); digit += 4) {
      const size = load<u32>(digit);
      store<u32>(digit, next);
      next += size;
    }
  }
  begin(codes, a, 0, n, digits);
  move(a, b, 0, n, 8, digits + 1024);
  move(b, a, 0, n, 16, digits + 2048);
  move(a, b, 0, n, 24, digits + 3072);
  for (let k: usize = 0; k < <usize>n; k++) store<u32>(codes + 4 * k, load<u32>(own + 4 * <usize>load<u32>(b + 8 * k, 4)));
  memory.copy(own, codes, 4 * <usize>n);
}

/**
 * Writes the distances of some splats from the nearest of those before and after them.
 * @param own [n] u32 splats. @param reach Number of splats on each side. @param distances [samples] f64 result.
 * @param work 12 n + 16 bytes.
 */
export function spacings(own: usize, n: u32, samples: u32, reach: u32, distances: usize, work: usize): void {
  const xs = work;
  const ys = xs + 4 * <usize>n;
  const zs = ys + 4 * <usize>n;
  for (let k: usize = 0; k < <usize>n; k++) {
    const p = positions + 12 * <usize>load<u32>(own + 4 * k);
    store<f32>(xs + 4 * k, load<f32>(p));
    store<f32>(ys + 4 * k, load<f32>(p, 4));
    store<f32>(zs + 4 * k, load<f32>(p, 8));
  }
  for (let s: u32 = 0; s < samples; s++) {
    const k = <u32>((<u64>s * n) / samples);
    const at = 4 * <usize>k;
    const x = <f64>load<f32>(xs + at);
    const y = <f64>load<f32>(ys + at);
    const z = <f64>load<f32>(zs + at);
    let nearest = f64x2.splat(Infinity);
    for (let side = 0; side < 2; side++) {
      const first = side ? k + 1 : k > reach ? k - reach : 0;
      const end = side ? min<u32>(n, k + reach) : k;
      for (let j = first; j < end; j += 2) {
        const to = 4 * <usize>j;
        const dx = f64x2.sub(f64x2.splat(x), f64x2.promote_low_f32x4(v128.load64_zero(xs + to)));
        const dy = f64x2.sub(f64x2.splat(y), f64x2.promote_low_f32x4(v128.load64_zero(ys + to)));
        const dz = f64x2.sub(f64x2.splat(z), f64x2.promote_low_f32x4(v128.load64_zero(zs + to)));
        let square = f64x2.add(f64x2.add(f64x2.mul(dx, dx), f64x2.mul(dy, dy)), f64x2.mul(dz, dz));
        if (j + 1 == end) square = f64x2.replace_lane(square, 1, Infinity);
        nearest = f64x2.pmin(nearest, square);
      }
    }
    store<f64>(
      distances + 8 * <usize>s,
      sqrt<f64>(min<f64>(f64x2.extract_lane(nearest, 0), f64x2.extract_lane(nearest, 1))),
    );
  }
}

/**
 * Packs splats as quantized chunks. @param own [n] u32 splats.
 * @param geometry Words of chunks, zero: 32 bytes, then 16 for each splat. @param sh `shBytes` of each splat, zero.
 * @param chunks [chunks, 8] float32: box and reach.
 */
export function pack(own: usize, n: u32, geometry: usize, sh: usize, shBytes: u32, chunks: usize): void {
  // [6, 256] float32 factors and [3, 256] float64 lengths.
  const factors = scratch;
  const lengths = factors + 6 * 1024;
  const visible = load<f64>(numbers);
  const firstVisible = load<f64>(numbers, 8);
  const opaque = load<f64>(numbers, 16);
  const sizes = load<f64>(numbers, 24);
  const zero2 = load<f64>(numbers, 32);
  const zero3 = load<f64>(numbers, 40);
  const centers = load<f64>(numbers, 56);
  const farthest = 1.0001 * sqrt<f64>(2 * log(1 / visible));
  const two = f64x2.splat(2);
  const shNumbers = <usize>(3 * (degree + 1) * (degree + 1));
  let chunk = chunks;
  let head = geometry;
  for (let first: u32 = 0; first < n; first += 256, chunk += 32, head += 4128) {
    const end = min<u32>(n, first + 256);
    let low = f32x4.splat(Infinity);
    let high = f32x4.splat(-Infinity);
    let reach: f64 = 0;
    let smallest = f64x2.splat(Infinity);
    let largest = f64x2.splat(0);
    let f = factors;
    let l = lengths;
    // Two splats at once. An odd last one is its own partner.
    for (let k = first; k < end; k += 2, f += 8, l += 16) {
      const i = <usize>load<u32>(own + 4 * <usize>k);
      const j = k + 1 < end ? <usize>load<u32>(own + 4 * <usize>k, 4) : i;
      const place = v128.load(positions + 12 * i);
      const place2 = v128.load(positions + 12 * j);
      low = f32x4.pmin(f32x4.pmin(low, place), place2);
      high = f32x4.pmax(f32x4.pmax(high, place), place2);
      const size = v128.load(scales + 12 * i);
      const size2 = v128.load(scales + 12 * j);
      const sx = f64x2.promote_low_f32x4(v128.shuffle<f32>(size, size2, 0, 4, 0, 4));
      const sy = f64x2.promote_low_f32x4(v128.shuffle<f32>(size, size2, 1, 5, 1, 5));
      const sz = f64x2.promote_low_f32x4(v128.shuffle<f32>(size, size2, 2, 6, 2, 6));
      const longest = f64x2.max(sx, f64x2.max(sy, sz));
      if (v128.any_true(f64x2.ge(f64x2.mul(f64x2.splat(farthest), longest), f64x2.splat(reach)))) {
        reach = max<f64>(reach, reachOf(f64x2.extract_lane(longest, 0), load<f32>(opacities + 4 * i), visible));
        reach = max<f64>(reach, reachOf(f64x2.extract_lane(longest, 1), load<f32>(opacities + 4 * j), visible));
      }
      // See `scaleRotationFactor`.
      const turn = v128.load(rotations + 16 * i);
      const turn2 = v128.load(rotations + 16 * j);
      let w = f64x2.promote_low_f32x4(v128.shuffle<f32>(turn, turn2, 0, 4, 0, 4));
      let x = f64x2.promote_low_f32x4(v128.shuffle<f32>(turn, turn2, 1, 5, 1, 5));
      let y = f64x2.promote_low_f32x4(v128.shuffle<f32>(turn, turn2, 2, 6, 2, 6));
      let z = f64x2.promote_low_f32x4(v128.shuffle<f32>(turn, turn2, 3, 7, 3, 7));
      const most = f64x2.max(f64x2.max(f64x2.abs(w), f64x2.abs(x)), f64x2.max(f64x2.abs(y), f64x2.abs(z)));
      w = f64x2.div(w, most);
      x = f64x2.div(x, most);
      y = f64x2.div(y, most);
      z = f64x2.div(z, most);
      const norm = f64x2.add(dot(w, w, x, x, y, y), square(z));
      const unit = f64x2.div(f64x2.splat(1), f64x2.sqrt(norm));
      w = f64x2.mul(w, unit);
      x = f64x2.mul(x, unit);
      y = f64x2.mul(y, unit);
      z = f64x2.mul(z, unit);
      const xy = f64x2.mul(x, y);
      const xz = f64x2.mul(x, z);
      const yz = f64x2.mul(y, z);
      const wx = f64x2.mul(w, x);
      const wy = f64x2.mul(w, y);
      const wz = f64x2.mul(w, z);
      const ax = diagonal(y, z, sx);
      const ay = f64x2.mul(f64x2.mul(two, f64x2.sub(xy, wz)), sy);
      const az = f64x2.mul(f64x2.mul(two, f64x2.add(xz, wy)), sz);
      let bx = f64x2.mul(f64x2.mul(two, f64x2.add(xy, wz)), sx);
      let by = diagonal(x, z, sy);
      let bz = f64x2.mul(f64x2.mul(two, f64x2.sub(yz, wx)), sz);
      let cx = f64x2.mul(f64x2.mul(two, f64x2.sub(xz, wy)), sx);
      let cy = f64x2.mul(f64x2.mul(two, f64x2.add(yz, wx)), sy);
      let cz = diagonal(x, y, sz);
      const xx = f64x2.sqrt(dot(ax, ax, ay, ay, az, az));
      const ix = inverse(xx);
      const yx = f64x2.mul(dot(ax, bx, ay, by, az, bz), ix);
      const zx = f64x2.mul(dot(ax, cx, ay, cy, az, cz), ix);
      bx = without(bx, yx, ax, ix);
      by = without(by, yx, ay, ix);
      bz = without(bz, yx, az, ix);
      cx = without(cx, zx, ax, ix);
      cy = without(cy, zx, ay, ix);
      cz = without(cz, zx, az, ix);
      const yy = f64x2.sqrt(dot(bx, bx, by, by, bz, bz));
      const iy = inverse(yy);
      const zy = f64x2.mul(dot(bx, cx, by, cy, bz, cz), iy);
      cx = without(cx, zy, bx, iy);
      cy = without(cy, zy, by, iy);
      cz = without(cz, zy, bz, iy);
      const zz = f64x2.sqrt(dot(cx, cx, cy, cy, cz, cz));
      const p = stored(xx, f);
      const q0 = stored(yx, f + 1024);
      const q1 = stored(yy, f + 2048);
      const r0 = stored(zx, f + 3072);
      const r1 = stored(zy, f + 4096);
      const r2 = stored(zz, f + 5120);
      const q = f64x2.sqrt(f64x2.add(square(q0), square(q1)));
      const r = f64x2.sqrt(dot(r0, r0, r1, r1, r2, r2));
      v128.store(l, p);
      v128.store(l, q, 2048);
      v128.store(l, r, 4096);
      smallest = f64x2.min(smallest, f64x2.min(p, f64x2.min(q, r)));
      largest = f64x2.max(largest, f64x2.max(p, f64x2.max(q, r)));
    }
    v128.store(chunk, f32x4.replace_lane(low, 3, <f32>(<f64>(<f32>reach) * load<f64>(numbers, 64))));
    v128.store(chunk, f32x4.replace_lane(high, 3, 0), 16);
    const greatest = max<f64>(f64x2.extract_lane(largest, 0), f64x2.extract_lane(largest, 1));
    const least = min<f64>(f64x2.extract_lane(smallest, 0), f64x2.extract_lane(smallest, 1));
    const top = greatest > 0 ? log2Of(greatest) : 0;
    const size = <f32>max<f64>(top - load<f64>(numbers, 48), min<f64>(top, log2Of(least)));
    v128.store(head, f32x4.replace_lane(low, 3, size));
    for (let axis: usize = 0; axis < 3; axis++) {
      const from = load<f32>(head + 4 * axis);
      const to = load<f32>(chunk + 16 + 4 * axis);
      store<f32>(head + 16 + 4 * axis, roundedUp((<f64>to - <f64>from) / centers));
    }
    store<f32>(head, roundedUp((top - <f64>size) / sizes), 28);
    const lowX = <f64>f32x4.extract_lane(low, 0);
    const lowY = <f64>f32x4.extract_lane(low, 1);
    const lowZ = <f64>f32x4.extract_lane(low, 2);
    const stepX = <f64>load<f32>(head, 16);
    const stepY = <f64>load<f32>(head, 20);
    const stepZ = <f64>load<f32>(head, 24);
    const octaves = <f64>load<f32>(head, 28);
    let row = head + 32;
    f = factors;
    l = lengths;
    for (let k = first; k < end; k += 2, f += 8, l += 16, row += 32) {
      const i = <usize>load<u32>(own + 4 * <usize>k);
      const isPair = k + 1 < end;
      const j = isPair ? <usize>load<u32>(own + 4 * <usize>k, 4) : i;
      const place = v128.load(positions + 12 * i);
      const place2 = v128.load(positions + 12 * j);
      const x = codesOf(f64x2.promote_low_f32x4(v128.shuffle<f32>(place, place2, 0, 4, 0, 4)), lowX, stepX, centers);
      const y = codesOf(f64x2.promote_low_f32x4(v128.shuffle<f32>(place, place2, 1, 5, 1, 5)), lowY, stepY, centers);
      const z = codesOf(f64x2.promote_low_f32x4(v128.shuffle<f32>(place, place2, 2, 6, 2, 6)), lowZ, stepZ, centers);
      const size0 = codesOf(log2(v128.load(l)), <f64>size, octaves, sizes);
      const size1 = codesOf(log2(v128.load(l, 2048)), <f64>size, octaves, sizes);
      const size2 = codesOf(log2(v128.load(l, 4096)), <f64>size, octaves, sizes);
      // The diagonal is not negative here.
      const yx = f64x2.promote_low_f32x4(v128.load64_zero(f, 1024));
      const yy = f64x2.promote_low_f32x4(v128.load64_zero(f, 2048));
      const zx = f64x2.promote_low_f32x4(v128.load64_zero(f, 3072));
      const zy = f64x2.promote_low_f32x4(v128.load64_zero(f, 4096));
      const zz = f64x2.promote_low_f32x4(v128.load64_zero(f, 5120));
      const t = directions(yx, f64x2.add(f64x2.abs(yx), yy), zero2);
      const sum = f64x2.add(f64x2.add(f64x2.abs(zx), f64x2.abs(zy)), zz);
      const u = directions(f64x2.add(zx, zy), sum, zero3);
      const v = directions(f64x2.sub(zx, zy), sum, zero3);
      const one = f32x4.replace_lane(f32x4.splat(load<f32>(opacities + 4 * i)), 1, load<f32>(opacities + 4 * j));
      const opacity = f64x2.promote_low_f32x4(f32x4.min(f32x4.splat(1), f32x4.max(f32x4.splat(0), one)));
      const nearest = f64x2.min(
        f64x2.splat(4095),
        f64x2.max(f64x2.splat(0), rounded(f64x2.mul(opacity, f64x2.splat(opaque)))),
      );
      const seen = i32x4.trunc_sat_f64x2_u_zero(
        v128.bitselect(
          f64x2.max(nearest, f64x2.splat(firstVisible)),
          f64x2.min(nearest, f64x2.splat(firstVisible - 1)),
          f64x2.ge(opacity, f64x2.splat(visible)),
        ),
      );
      const a = v128.or(x, i32x4.shl(y, 16));
      const b = v128.or(z, v128.or(i32x4.shl(u, 16), i32x4.shl(t, 29)));
      const c = v128.or(
        v128.or(size0, i32x4.shl(size1, 10)),
        v128.or(i32x4.shl(size2, 20), i32x4.shl(i32x4.shr_u(t, 3), 30)),
      );
      const d = v128.or(v, v128.or(i32x4.shl(seen, 13), i32x4.shl(i32x4.shr_u(t, 5), 25)));
      const ab = v128.shuffle<i32>(a, b, 0, 4, 1, 5);
      const cd = v128.shuffle<i32>(c, d, 0, 4, 1, 5);
      v128.store(row, v128.shuffle<i64>(ab, cd, 0, 2));
      color(harmonics + 4 * shNumbers * i, sh + <usize>k * shBytes);
      if (!isPair) continue;
      v128.store(row, v128.shuffle<i64>(ab, cd, 1, 3), 16);
      color(harmonics + 4 * shNumbers * j, sh + <usize>(k + 1) * shBytes);
    }
  }
}

/** See `reachOf` of the renderer. */
function reachOf(longest: f64, opacity: f32, visible: f64): f64 {
  return longest * sqrt<f64>(2 * log(max<f64>(1, min<f64>(1, <f64>opacity) / visible)));
}

/** Writes the harmonics of a splat as `packSh` does. */
function color(from: usize, to: usize): void {
  if (isHalf || degree == 0) {
    const all = <usize>(3 * (isHalf ? (degree + 1) * (degree + 1) : 1));
    for (let k: usize = 0; k < all; k++) store<u16>(to + 2 * k, <u16>halfBits(load<f32>(from + 4 * k)));
    return;
  }
  for (let k: usize = 0; k < 3; k++) store<u16>(to + 2 * k, <u16>halfBits(load<f32>(from + 4 * k)));
  let at = from + 12;
  let code = to + 8;
  for (let band = 0; band < degree; band++) {
    const end = at + 12 * <usize>(2 * band + 3);
    let largest: i32 = 0;
    for (let k = at; k < end; k += 4) largest = max<i32>(largest, load<i32>(k) & 0x7fffffff);
    const scale = scaleCode(largest, numbers + 128 + 2048);
    const factor = load<f64>(numbers + 128 + 8 * scale);
    store<u8>(to + (band == 0 ? 6 : band == 1 ? 7 : 53), <u8>scale);
    for (let k = at; k < end; k += 4) {
      // Degree 1 has nine codes but eight places: the last code replaces the scale of band 2.
      const place = degree == 1 && k + 4 == end ? to + 7 : code++;
      store<u8>(place, <u8>(<i32>(<f64>load<f32>(k) * factor + 256.5)));
    }
    at = end;
  }
}
