// A quad of a splat in a scene without meshes. The fragment evaluates the Gaussian at the pixel center from flat
// inputs, so nothing is interpolated and the math equals that of the other rasterizers.
#import shared/quad

struct Quad {
  @builtin(position) position: vec4f,
  @location(0) @interpolate(flat, either) shape: vec4f,
  // red, green, blue, opacity
  @location(1) @interpolate(flat, either) color: vec4f,
  @location(2) @interpolate(flat, either) inverse_sigma_v: f32,
}

fn no_quad() -> Quad {
  return Quad(vec4f(2.0, 2.0, 0.0, 1.0), vec4f(0.0), vec4f(0.0), 0.0);
}

fn quad_of(s: ProjectedSplat, vertex_index: u32) -> Quad {
  let color = vec4f(splat_color(s), bitcast<f32>(s.paint.w));
  return Quad(place_of(s, vertex_index), s.shape, color, bitcast<f32>(s.paint.x));
}

@fragment
fn fragment(quad: Quad) -> @location(0) vec4f {
  let offset = quad.position.xy - quad.shape.xy;
  let alpha = alpha_at(offset, quad.shape.z, quad.shape.w, quad.inverse_sigma_v, quad.color.a);
  if (alpha < ALPHA_MIN) { discard; }
  // Blended as color = alpha · color + (1 - alpha) · color behind, and transmittance = (1 - alpha) · transmittance.
  return vec4f(quad.color.rgb * alpha, alpha);
}
