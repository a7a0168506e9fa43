#import shared/group

// Converts an image to a tensor [views,channels,height,width]: depth, or red, green, blue and optional alpha planes in
// 0..1, top row first. If sizes differ each pixel is a mean with triangular weights, as wide as the step between pixels
// (antialiased bilinear); texels outside the image have no weight. Depth is that of the nearest texel: a mean of two
// surfaces lies on neither.
@group(0) @binding(0) var<uniform> image: ImageToTensor;
@group(0) @binding(1) var source: texture_2d<f32>;
// float32, or two float16 in each word.
@group(0) @binding(2) var<storage, read_write> tensor: array<u32>;

struct ImageToTensor {
  // Upper left corner of the source region, in pixels of the image.
  corner: vec2f,
  // Pixels of the image for each pixel of the tensor, across and down.
  step: vec2f,
  // Width and height of the tensor.
  size: vec2u,
  is_half: u32,
  // 1 for depth, 3, or 4 with alpha.
  channels: u32,
  // Offset of this image in the tensor, in words.
  first_word: u32,
}

const IMAGE_GROUP = 64u;

fn mean(at: vec2u, channel: u32) -> f32 {
  let center = image.corner + (vec2f(at) + 0.5) * image.step;
  let radius = max(image.step, vec2f(1.0));
  let last = vec2i(textureDimensions(source)) - 1;
  let first_tap = max(vec2i(floor(center - radius - 0.5)) + 1, vec2i(0));
  let last_tap = min(vec2i(ceil(center + radius - 0.5)) - 1, last);
  var sum = 0.0;
  var weights = 0.0;
  for (var y = first_tap.y; y <= last_tap.y; y++) {
    for (var x = first_tap.x; x <= last_tap.x; x++) {
      let distance = abs(vec2f(f32(x), f32(y)) + 0.5 - center) / radius;
      let weight = (1.0 - distance.x) * (1.0 - distance.y);
      sum += weight * textureLoad(source, vec2i(x, y), 0)[channel];
      weights += weight;
    }
  }
  return clamp(sum / max(weights, 1e-20), 0.0, 1.0);
}

fn nearest(at: vec2u) -> f32 {
  let center = vec2i(floor(image.corner + (vec2f(at) + 0.5) * image.step));
  let last = vec2i(textureDimensions(source)) - 1;
  return textureLoad(source, clamp(center, vec2i(0), last), 0).x;
}

fn element(index: u32) -> f32 {
  let plane = image.size.x * image.size.y;
  if (index >= image.channels * plane) { return 0.0; }
  let pixel = index % plane;
  let at = vec2u(pixel % image.size.x, pixel / image.size.x);
  if (image.channels == 1u) { return nearest(at); }
  return mean(at, index / plane);
}

@compute @workgroup_size(IMAGE_GROUP)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
  let word = group_index(group) * IMAGE_GROUP + lane;
  let elements = image.channels * image.size.x * image.size.y;
  if (image.is_half == 1u) {
    if (2u * word < elements) { tensor[image.first_word + word] = pack2x16float(vec2f(element(2u * word), element(2u * word + 1u))); }
  } else if (word < elements) {
    tensor[image.first_word + word] = bitcast<u32>(element(word));
  }
}
