// Composes into a target of linear light. Splats and the content behind them are blended in encoded colors, as scenes
// are trained.
#import shared/compose
#import shared/full_screen
#import shared/srgb

// The previous content of the target, in linear light.
@group(0) @binding(2) var content: texture_2d<f32>;

// True to blend splats over that content, false to blend them over the background.
override keeps: bool = true;

fn encoded(c: vec3f) -> vec3f {
  return select(1.055 * pow(max(c, vec3f(0.0)), vec3f(1.0 / 2.4)) - 0.055, 12.92 * c, c <= vec3f(0.0031308));
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
  let pixel = painted(position.xy);
  var behind = compose.background;
  if (keeps) {
    let held = textureLoad(content, vec2u(position.xy), 0);
    // No splat covers the pixel, so the content is returned bit for bit.
    if (pixel.a >= 1.0) { return held; }
    behind = vec4f(encoded(held.rgb), held.a);
  }
  let transmittance = pixel.a;
  return vec4f(decoded(pixel.rgb + transmittance * behind.rgb), 1.0 - transmittance + transmittance * behind.a);
}
