// What becomes of accumulated splats: they are laid over the background as premultiplied colour. An accumulation smaller than the target is
// interpolated between its pixels' centres.
@group(0) @binding(0) var<uniform> compose: Compose;
// Colour, and transmittance in the alpha channel.
@group(0) @binding(1) var accumulated: texture_2d<f32>;

struct Compose {
  // Premultiplied red, green, blue and alpha.
  background: vec4f,
  // Pixels of the accumulation for each pixel of the target, across and down; 1 where they are the same size.
  scale: vec2f,
  // Pixels of the accumulation that are in use, from its first on.
  used: vec2f,
}

fn interpolated(position: vec2f) -> vec4f {
  let last = vec2i(compose.used) - 1;
  let at = position * compose.scale - 0.5;
  let share = fract(at);
  let low = vec2i(floor(at));
  let a = clamp(low, vec2i(0), last);
  let b = clamp(low + 1, vec2i(0), last);
  let top = mix(textureLoad(accumulated, a, 0), textureLoad(accumulated, vec2i(b.x, a.y), 0), share.x);
  let bottom = mix(textureLoad(accumulated, vec2i(a.x, b.y), 0), textureLoad(accumulated, b, 0), share.x);
  return mix(top, bottom, share.y);
}

// Colour and transmittance at the centre of a pixel.
fn painted(position: vec2f) -> vec4f {
  if (all(compose.scale == vec2f(1.0))) { return textureLoad(accumulated, vec2u(position), 0); }
  return interpolated(position);
}

// The target's colour at the centre of a pixel.
fn composed(position: vec2f) -> vec4f {
  let pixel = painted(position);
  let transmittance = pixel.a;
  return vec4f(pixel.rgb, 1.0 - transmittance) + transmittance * compose.background;
}
