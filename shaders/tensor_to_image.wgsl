// Converts a tensor [1,3,height,width] to an image, interpolated if sizes differ. The alpha is that of the input frame,
// and colors are clamped to it: premultiplied, and transparent like the scene.
@group(0) @binding(0) var<uniform> image: TensorToImage;
// float32, or two float16 in each word.
@group(0) @binding(1) var<storage, read> tensor: array<u32>;
@group(0) @binding(2) var frame: texture_2d<f32>;

struct TensorToImage {
  // Width and height of the tensor.
  size: vec2u,
  is_half: u32,
}

const EXPONENT = 0x7f800000u;
const HALF_EXPONENT = 0x7c00u;

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
  // One triangle covers the image.
  return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// An element of the tensor, and 1 if it is finite.
fn element(index: u32) -> vec2f {
  if (image.is_half == 0u) {
    let bits = tensor[index];
    if ((bits & EXPONENT) == EXPONENT) { return vec2f(0.0); }
    return vec2f(bitcast<f32>(bits), 1.0);
  }
  let bits = (tensor[index / 2u] >> (16u * (index & 1u))) & 0xffffu;
  if ((bits & HALF_EXPONENT) == HALF_EXPONENT) { return vec2f(0.0); }
  return vec2f(unpack2x16float(bits).x, 1.0);
}

// Color of a pixel, and 1 if all of it is finite.
fn pixel(at: vec2u) -> vec4f {
  let plane = image.size.x * image.size.y;
  let index = at.y * image.size.x + at.x;
  let red = element(index);
  let green = element(plane + index);
  let blue = element(2u * plane + index);
  return vec4f(red.x, green.x, blue.x, red.y * green.y * blue.y);
}

fn interpolated(position: vec2f, target_size: vec2f) -> vec4f {
  let last = vec2i(image.size) - 1;
  let at = position * vec2f(image.size) / target_size - 0.5;
  let share = fract(at);
  let low = vec2i(floor(at));
  let a = vec2u(clamp(low, vec2i(0), last));
  let b = vec2u(clamp(low + 1, vec2i(0), last));
  let top = mix(pixel(a), pixel(vec2u(b.x, a.y)), share.x);
  let bottom = mix(pixel(vec2u(a.x, b.y)), pixel(b), share.x);
  return mix(top, bottom, share.y);
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
  let at = vec2u(position.xy);
  let plain = textureLoad(frame, at, 0);
  let size = textureDimensions(frame);
  var color: vec4f;
  if (all(size == image.size)) { color = pixel(at); } else { color = interpolated(position.xy, vec2f(size)); }
  // Shows the unmodified frame if the output of the model is not finite.
  if (color.a < 1.0) { return plain; }
  let alpha = clamp(plain.a, 0.0, 1.0);
  return vec4f(clamp(color.rgb, vec3f(0.0), vec3f(alpha)), alpha);
}
