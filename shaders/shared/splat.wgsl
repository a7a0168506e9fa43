// A projected splat: what a rasterizer needs, in two words of 16 bytes.
struct ProjectedSplat {
  // center.x, center.y (pixels), 1 / sigma_x (1/px), slope: see Ellipse in shared/projection
  shape: vec4f,
  // 1 / sigma_v (1/px, float32), red and green (float16), blue (float16), opacity (float32)
  paint: vec4u,
}

// Colours above this would overflow a float16 accumulation target.
const COLOR_MAX = 16384.0;

fn pack_splat(center: vec2f, sigma_x: f32, slope: f32, sigma_v: f32, color: vec3f, opacity: f32) -> ProjectedSplat {
  let c = clamp(color, vec3f(0.0), vec3f(COLOR_MAX));
  return ProjectedSplat(
    vec4f(center, 1.0 / sigma_x, slope),
    vec4u(bitcast<u32>(1.0 / sigma_v), pack2x16float(c.rg), pack2x16float(vec2f(c.b, 0.0)), bitcast<u32>(opacity)),
  );
}

fn splat_color(s: ProjectedSplat) -> vec3f {
  return vec3f(unpack2x16float(s.paint.y), unpack2x16float(s.paint.z).x);
}
