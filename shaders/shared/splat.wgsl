// A projected splat: the input of the rasterizers, in two words of 16 bytes.
#import shared/ellipse

struct ProjectedSplat {
  // center.x, center.y (pixels), 1 / sigma_x (1/px), slope: see Ellipse
  shape: vec4f,
  // 1 / sigma_v (1/px, float32), red and green (float16), blue (float16) and depth (see depth_code), opacity (float32)
  paint: vec4u,
}

// Colors above this would overflow a float16 accumulation target.
const COLOR_MAX = 16384.0;

// A depth in 16 bits: 10 bits of mantissa, as float16 has, and 62 exponents, because scenes have any size. These are
// the bits of 2^-28, the minimum depth; the maximum is 2^34.
const DEPTH_FIRST = 0x31800000u;
const DEPTH_LAST = 0xf7ffu;
// Codes that would be infinity or NaN as float16 are skipped, because the other half that unpacks with them is blue.
const NO_HALF = 0x7c00u;
const NO_HALVES = 0x400u;

fn depth_code(depth: f32) -> u32 {
  let steps = min((max(bitcast<u32>(depth), DEPTH_FIRST) - DEPTH_FIRST + 0x1000u) >> 13u, DEPTH_LAST);
  return select(steps, steps + NO_HALVES, steps >= NO_HALF);
}

// The depth in the upper half of a word.
fn depth_in(word: u32) -> f32 {
  let code = word >> 16u;
  return bitcast<f32>((select(code, code - NO_HALVES, code >= NO_HALF) << 13u) + DEPTH_FIRST);
}

fn pack_splat(e: Ellipse, color: vec3f) -> ProjectedSplat {
  let c = clamp(color, vec3f(0.0), vec3f(COLOR_MAX));
  let blue_depth = pack2x16float(vec2f(c.b, 0.0)) | (depth_code(e.depth) << 16u);
  return ProjectedSplat(
    vec4f(e.center, 1.0 / e.sigma_x, e.slope),
    vec4u(bitcast<u32>(1.0 / e.sigma_v), pack2x16float(c.rg), blue_depth, bitcast<u32>(e.opacity)),
  );
}

fn splat_color(s: ProjectedSplat) -> vec3f {
  return vec3f(unpack2x16float(s.paint.y), unpack2x16float(s.paint.z).x);
}

// World units along the optical axis, to 11 bits.
fn splat_depth(s: ProjectedSplat) -> f32 {
  return depth_in(s.paint.z);
}
