// Lays the accumulated splats over the background and writes premultiplied colour.
@group(0) @binding(0) var<uniform> compose: Compose;
// Colour, and transmittance in the alpha channel.
@group(0) @binding(1) var accumulated: texture_2d<f32>;

struct Compose {
  // Premultiplied red, green, blue and alpha.
  background: vec4f,
}

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
  // One triangle that covers the image.
  return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
  let pixel = textureLoad(accumulated, vec2u(position.xy), 0);
  let transmittance = pixel.a;
  return vec4f(pixel.rgb, 1.0 - transmittance) + transmittance * compose.background;
}
