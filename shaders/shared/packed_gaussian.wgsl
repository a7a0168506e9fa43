// The geometry of a Gaussian in 32 bytes, precise enough for images.
#import shared/gaussian

// Storage layout of a Gaussian: 32 bytes. Loaded as integers, because only integer bits can reveal a NaN or an
// infinity: WGSL allows compilers to assume that floating-point math never produces one.
struct PackedGaussian {
  // x, y, z (float32, block-local); in the upper 22 bits of the last word the upper 22 of a float32, factor xx, and so
  // on for yx, yy, zx, zy in `tail`. The lower 10 bits of these five words hold, in turn, the upper 22 bits of factor
  // zz and the upper 28 of the opacity.
  head: vec4u,
  tail: vec4u,
}

const EXPONENT_BITS = 0x7f800000u;
const HIGH_22 = 0xfffffc00u;
// Longest standard deviation of a drawable splat: MIN_LONGEST_SCALE and MAX_SCALE of core.
const MIN_LONGEST_SCALE = 1e-12;
const MAX_SCALE = 1e12;
// Bits of its largest coordinate, MAX_POSITION of core: compared as integers, because bounds of chunks must never
// contain a NaN or an infinity.
const MAX_POSITION_BITS = 0x5d5e0b6bu;

// The float32 words of factor xx, yx, yy, zx and of factor zy, zz and the opacity.
fn shape_words(g: PackedGaussian) -> array<vec4u, 2> {
  let own = vec4u(g.head.w, g.tail.xyz) & vec4u(HIGH_22);
  let last = (g.head.w << 22u) | ((g.tail.x & 0x3ffu) << 12u) | ((g.tail.y & 0x300u) << 2u);
  let opacity = (g.tail.y << 24u) | ((g.tail.z & 0x3ffu) << 14u) | ((g.tail.w & 0x3ffu) << 4u);
  return array<vec4u, 2>(own, vec4u(g.tail.w & HIGH_22, last, opacity, 0u));
}

fn unpack_gaussian(g: PackedGaussian) -> Gaussian {
  let words = shape_words(g);
  let own = bitcast<vec4f>(words[0]);
  let rest = bitcast<vec4f>(words[1]);
  return Gaussian(
    bitcast<vec3f>(g.head.xyz),
    rest.z,
    vec3f(own.x, own.y, own.w),
    vec2f(own.z, rest.x),
    rest.y,
  );
}

fn position_of(g: PackedGaussian) -> vec3f {
  return bitcast<vec3f>(g.head.xyz);
}

// Whether four float32 have exponents other than that of NaN and infinity.
fn has_finite_bits(words: vec4u) -> bool {
  let exponents = words & vec4u(EXPONENT_BITS);
  return all(exponents != vec4u(EXPONENT_BITS));
}

// Whether all numbers are finite and in range, and the factor is not zero.
fn is_usable(g: PackedGaussian) -> bool {
  let words = shape_words(g);
  let is_near = all((g.head.xyz & vec3u(0x7fffffffu)) <= vec3u(MAX_POSITION_BITS));
  let finite = is_near && has_finite_bits(words[0]) && has_finite_bits(words[1]);
  let own = abs(bitcast<vec4f>(words[0]));
  let rest = abs(bitcast<vec4f>(words[1]));
  let largest = max(max(max(own.x, own.y), max(own.z, own.w)), max(rest.x, rest.y));
  // No entry of the factor exceeds the longest axis, and the largest entry is at least 1/√3 of it.
  return finite && largest >= 0.5 * MIN_LONGEST_SCALE && largest <= 1.001 * MAX_SCALE;
}
