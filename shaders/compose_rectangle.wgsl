// Composes into a rectangle of a target: the viewport of the pass.
#import shared/compose
#import shared/srgb

// True for targets that apply the sRGB encoding on store, as in `compose`.
override is_encoding: bool = false;

struct Corner {
  @builtin(position) position: vec4f,
  // Position as fractions of the image, from its upper left corner.
  @location(0) place: vec2f,
}

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> Corner {
  let at = vec2f(f32(i & 1u), f32(i >> 1u)) * 4.0 - 1.0;
  return Corner(vec4f(at, 0.0, 1.0), vec2f(0.5, -0.5) * at + 0.5);
}

@fragment
fn fragment(corner: Corner) -> @location(0) vec4f {
  // Pixels are counted by interpolation, which is exact to far less than half a pixel.
  let color = composed(floor(corner.place * (compose.used / compose.scale)) + 0.5);
  if (is_encoding) { return vec4f(decoded(color.rgb), color.a); }
  return color;
}
