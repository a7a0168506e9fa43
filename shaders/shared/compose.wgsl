// Composes accumulated splats over the background as premultiplied color. An accumulation smaller than the target is
// upsampled by a cubic filter, which keeps more of fine detail than a linear one (1 to 2 dB).
@group(0) @binding(0) var<uniform> compose: Compose;
// Color, with the transmittance in the alpha channel.
@group(0) @binding(1) var accumulated: texture_2d<f32>;

struct Compose {
  // Premultiplied red, green, blue and alpha.
  background: vec4f,
  // Pixels of the accumulation for each pixel of the target, across and down; 1 if the sizes are equal.
  scale: vec2f,
  // Size of the used region of the accumulation, in pixels from its first one.
  used: vec2f,
}

// Weights of four pixels in a row: the cubic of Catmull and Rom (1974) at a fraction of the way from the second to the
// third.
fn cubic_weights(share: f32) -> vec4f {
  let t = vec4f(1.0, share, share * share, share * share * share);
  return mat4x4f(0.0, 1.0, 0.0, 0.0, -0.5, 0.0, 0.5, 0.0, 1.0, -2.5, 2.0, -0.5, -0.5, 1.5, -1.5, 0.5) * t;
}

fn interpolated(position: vec2f) -> vec4f {
  let last = vec2i(compose.used) - 1;
  let at = position * compose.scale - 0.5;
  let low = vec2i(floor(at)) - 1;
  let across = cubic_weights(fract(at.x));
  let down = cubic_weights(fract(at.y));
  var sum = vec4f(0.0);
  for (var y = 0; y < 4; y++) {
    var row = vec4f(0.0);
    for (var x = 0; x < 4; x++) {
      row += across[x] * textureLoad(accumulated, clamp(low + vec2i(x, y), vec2i(0), last), 0);
    }
    sum += down[y] * row;
  }
  // Clamped because the cubic overshoots beside edges.
  return vec4f(max(sum.rgb, vec3f(0.0)), clamp(sum.a, 0.0, 1.0));
}

// Color and transmittance at the center of a pixel.
fn painted(position: vec2f) -> vec4f {
  if (all(compose.scale == vec2f(1.0))) { return textureLoad(accumulated, vec2u(position), 0); }
  return interpolated(position);
}

// Color of the target at the center of a pixel.
fn composed(position: vec2f) -> vec4f {
  let pixel = painted(position);
  let transmittance = pixel.a;
  return vec4f(pixel.rgb, 1.0 - transmittance) + transmittance * compose.background;
}
