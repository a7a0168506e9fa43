// Storage of a rasterized pixel.
#import shared/bins

@group(0) @binding(5) var image: texture_storage_2d<rgba16float, write>;

// True to write premultiplied color over the background, false for color and transmittance.
override is_final: bool = false;
// True if the image holds float16, and true if it holds bytes. If neither is, it holds float32.
override writes_half: bool = true;
override writes_bytes: bool = false;

// Storing may truncate, which costs 5 dB. So the value is rounded to the nearest float16 of the normal range,
fn nearest_half(v: vec4f) -> vec4f {
  let bits = bitcast<vec4u>(v);
  let is_odd = (bits >> vec4u(13u)) & vec4u(1u);
  return bitcast<vec4f>((bits + vec4u(0xfffu) + is_odd) & vec4u(0xffffe000u));
}

// or to the nearest byte plus a margin, so that rounding and truncation both give that byte.
fn nearest_byte(v: vec4f) -> vec4f {
  return (floor(v * 255.0 + 0.5) + 0.25) / 255.0;
}

fn store_pixel(position: vec2u, color: vec3f, transmittance: f32) {
  var result = vec4f(color, transmittance);
  if (is_final) { result = vec4f(color, 1.0 - transmittance) + transmittance * view.background; }
  if (writes_half) { result = nearest_half(result); }
  if (writes_bytes) { result = nearest_byte(result); }
  textureStore(image, position, result);
}
