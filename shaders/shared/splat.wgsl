// A projected splat: what a rasterizer needs, in two words of 16 bytes.
#import shared/ellipse

struct ProjectedSplat {
  // center.x, center.y (pixels), 1 / sigma_x (1/px), slope: see Ellipse
  shape: vec4f,
  // 1 / sigma_v (1/px, float32), red and green (float16), blue and depth (float16), opacity (float32)
  paint: vec4u,
}

// Colours above this would overflow a float16 accumulation target.
const COLOR_MAX = 16384.0;

// Depths beyond it would be infinite in float16.
const HALF_MAX = 65504.0;

fn pack_splat(e: Ellipse, color: vec3f) -> ProjectedSplat {
  let c = clamp(color, vec3f(0.0), vec3f(COLOR_MAX));
  let blue_depth = pack2x16float(vec2f(c.b, min(e.depth, HALF_MAX)));
  return ProjectedSplat(
    vec4f(e.center, 1.0 / e.sigma_x, e.slope),
    vec4u(bitcast<u32>(1.0 / e.sigma_v), pack2x16float(c.rg), blue_depth, bitcast<u32>(e.opacity)),
  );
}

fn splat_color(s: ProjectedSplat) -> vec3f {
  return vec3f(unpack2x16float(s.paint.y), unpack2x16float(s.paint.z).x);
}

// World units along the camera's axis, to 11 bits.
fn splat_depth(s: ProjectedSplat) -> f32 {
  return unpack2x16float(s.paint.z).y;
}
