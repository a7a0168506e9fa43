// `compose` into a rectangle of a framebuffer, whose rows WebGL counts from the bottom.
#import shared/compose

struct Corner {
  @builtin(position) position: vec4f,
  // Position as fractions of the image, from its upper left corner.
  @location(0) place: vec2f,
}

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> Corner {
  let at = vec2f(f32(i & 1u), f32(i >> 1u)) * 4.0 - 1.0;
  return Corner(vec4f(at, 0.0, 1.0), 0.5 * at + 0.5);
}

@fragment
fn fragment(corner: Corner) -> @location(0) vec4f {
  // The rectangle may lie anywhere in the framebuffer, so its pixels are counted by interpolation, which is exact to
  // far less than half a pixel.
  return composed(floor(corner.place * (compose.used / compose.scale)) + 0.5);
}
