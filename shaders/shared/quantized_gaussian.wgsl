// The geometry of Gaussians in 16 bytes, relative to their chunk: packages/renderer/src/streaming/quantized-geometry.ts
// writes it. Replaces shared/stored_gaussian for blocks in this layout.
//
// A chunk takes 258 rows. The first has the origin of its coordinates and the log2 of its smallest size (float32), the
// second the steps of both; then each splat has
// x  center: x, y, 16 bits each
// y  center: z, 16 bits; direction of the factor's third row: u, 13 bits; of the second: t, its bits 0 to 2
// z  log2 of the lengths of the factor's rows, 10 bits each; t, bits 3 and 4
// w  v, 13 bits; opacity, 12 bits; t, bits 5 to 11
#import shared/gaussian
#import shared/quantized_layout

const QUANTIZED_SIZES = 1023.0;
// Code of 0, halfway between the codes of -1 and 1.
const QUANTIZED_T_ZERO = 2047.0;
const QUANTIZED_UV_ZERO = 4095.0;
// Code of an opacity of 1; merged splats have up to 2.718.
const QUANTIZED_OPAQUE = 1500.0;
// Bounds against malformed files: the log2 of a size, and the bits of the largest length whose square is finite.
const QUANTIZED_LARGEST_SIZE = 40.0;
const QUANTIZED_FARTHEST = 0x5d000000u;

alias StoredGaussian = vec4u;

struct FoundGaussian {
  row: vec4u,
  origin: vec4u,
  step: vec4u,
}

fn gaussian_at(i: u32) -> FoundGaussian {
  let first = (i / CULL_GROUP) * QUANTIZED_CHUNK_ROWS;
  return FoundGaussian(gaussians[first + QUANTIZED_HEAD_ROWS + i % CULL_GROUP], gaussians[first], gaussians[first + 1u]);
}

// Whether the header of the chunk is in range, so that no splat of it can be out of bounds.
fn is_usable(g: FoundGaussian) -> bool {
  let magnitudes = vec4u(0x7fffffffu);
  if (any((g.origin & magnitudes) > vec4u(QUANTIZED_FARTHEST)) || any((g.step & magnitudes) > vec4u(QUANTIZED_FARTHEST))) { return false; }
  let smallest = bitcast<f32>(g.origin.w);
  let largest = smallest + QUANTIZED_SIZES * bitcast<f32>(g.step.w);
  return max(abs(smallest), abs(largest)) <= QUANTIZED_LARGEST_SIZE;
}

fn position_of(g: FoundGaussian) -> vec3f {
  let place = vec3u(g.row.x & 0xffffu, g.row.x >> 16u, g.row.y & 0xffffu);
  return bitcast<vec3f>(g.origin.xyz) + bitcast<vec3f>(g.step.xyz) * vec3f(place);
}

fn unpack_gaussian(g: FoundGaussian) -> Gaussian {
  let codes = vec3u(g.row.z & 1023u, (g.row.z >> 10u) & 1023u, (g.row.z >> 20u) & 1023u);
  let sizes = exp2(bitcast<f32>(g.origin.w) + bitcast<f32>(g.step.w) * vec3f(codes));
  // Unit vectors with a non-negative last coordinate, as points of the line |x| + y = 1 and of the plane |x| + |y| + z
  // = 1.
  let t = f32((g.row.y >> 29u) | ((g.row.z >> 30u) << 3u) | ((g.row.w >> 25u) << 5u)) / QUANTIZED_T_ZERO - 1.0;
  let second = normalize(vec2f(t, max(0.0, 1.0 - abs(t))));
  let uv = vec2f(f32((g.row.y >> 16u) & 0x1fffu), f32(g.row.w & 0x1fffu)) / QUANTIZED_UV_ZERO - 1.0;
  let across = 0.5 * vec2f(uv.x + uv.y, uv.x - uv.y);
  let third = normalize(vec3f(across, max(0.0, 1.0 - abs(across.x) - abs(across.y))));
  return Gaussian(
    position_of(g),
    f32((g.row.w >> 13u) & 0xfffu) / QUANTIZED_OPAQUE,
    vec3f(sizes.x, sizes.y * second.x, sizes.z * third.x),
    vec2f(sizes.y * second.y, sizes.z * third.y),
    sizes.z * third.z,
  );
}
