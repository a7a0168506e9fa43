// Packs the output tensors of one generator run into a block of Gaussians: one thread for each row, and one workgroup
// for each chunk, whose bounds it computes. Rows beyond the count become transparent splats; rows with an unusable
// value become zeros, which `cull` counts as unusable.
#import shared/packed_gaussian
#import shared/sh
#import shared/written_gaussian
#import shared/group

struct Ingest {
  // Live rows of this run, as the generator reports them; any value may occur.
  count: i32,
  // Rows of the tensors of this run.
  rows: u32,
  // Capacity of the block in rows, and the index of its first row among all rows.
  page_rows: u32,
  first_row: u32,
  // 1 for float16 tensors, which are read as integers, so that no device feature is required.
  is_half: u32,
  // Kind of `shape`, one of SHAPE_*, and its numbers in each row: 6 of a covariance, or the 9 of a matrix; 3 of scales,
  // or 1 for all axes.
  shape_kind: u32,
  shape_numbers: u32,
  // Kind of `colors`, one of COLOR_*.
  color_kind: u32,
  sh_degree: u32,
  // 1 for quaternions in the order w, x, y, z; 0 for x, y, z, w.
  is_w_first: u32,
  // 1 for opacities before the sigmoid.
  is_logit: u32,
  // Layout of each attribute: its offset in a row, and the length of the row, in elements.
  positions: vec2u,
  shapes: vec2u,
  rotations: vec2u,
  colors: vec2u,
  opacities: vec2u,
}

const SHAPE_COVARIANCE = 0u;
const SHAPE_SCALE = 1u;
const SHAPE_LOG_SCALE = 2u;
const COLOR_RGB = 0u;
const COLOR_COEFFICIENT_MAJOR = 1u;
const COLOR_CHANNEL_MAJOR = 2u;

@group(0) @binding(0) var<uniform> ingest: Ingest;
// The regions of the tensors that belong to the block, as 32-bit words. One tensor may be bound several times.
@group(0) @binding(1) var<storage, read> positions: array<u32>;
// Covariances, or scales.
@group(0) @binding(2) var<storage, read> shapes: array<u32>;
@group(0) @binding(3) var<storage, read> rotations: array<u32>;
// Red, green, blue, or spherical harmonics.
@group(0) @binding(4) var<storage, read> colors: array<u32>;
@group(0) @binding(5) var<storage, read> opacities: array<u32>;
@group(0) @binding(6) var<storage, read_write> gaussians: array<PackedGaussian>;
@group(0) @binding(7) var<storage, read_write> sh: array<vec2u>;
@group(0) @binding(8) var<storage, read_write> chunks: array<Chunk>;

const POSITIONS = 0u;
const SHAPES = 1u;
const ROTATIONS = 2u;
const COLORS = 3u;
const OPACITIES = 4u;

const HALF_MAX = 65504.0;
const LARGEST_LOG = 88.0;

fn tensor_word(tensor: u32, word: u32) -> u32 {
  switch tensor {
    case POSITIONS: { return positions[word]; }
    case SHAPES: { return shapes[word]; }
    case ROTATIONS: { return rotations[word]; }
    case COLORS: { return colors[word]; }
    default: { return opacities[word]; }
  }
}

// Expands a float16 to the bits of a float32, including subnormal numbers, infinities and NaN: `unpack2x16float` may
// lose all three.
fn widen(half: u32) -> u32 {
  let sign = (half & 0x8000u) << 16u;
  let magnitude = half & 0x7fffu;
  if (magnitude >= 0x7c00u) { return sign | EXPONENT_BITS | ((magnitude & 0x3ffu) << 13u); }
  if (magnitude < 0x0400u) { return sign | bitcast<u32>(f32(magnitude) * 5.960464477539063e-8); }
  return sign | ((magnitude << 13u) + 0x38000000u);
}

// Bits of element `component` of an attribute of a row.
fn bits_of(tensor: u32, slice: vec2u, row: u32, component: u32) -> u32 {
  let at = row * slice.y + slice.x + component;
  if (ingest.is_half == 0u) { return tensor_word(tensor, at); }
  return widen((tensor_word(tensor, at / 2u) >> (16u * (at & 1u))) & 0xffffu);
}

fn triple_of(tensor: u32, slice: vec2u, row: u32, component: u32) -> vec3u {
  return vec3u(
    bits_of(tensor, slice, row, component), bits_of(tensor, slice, row, component + 1u), bits_of(tensor, slice, row, component + 2u),
  );
}

fn are_finite(words: vec3u) -> bool {
  return has_finite_bits(vec4u(words, 0u));
}

// Cholesky factor. Pivots of needles and discs may be pure rounding error, or even negative. No number may then exceed
// the limit that the diagonal implies, so that L Lᵀ keeps the diagonal and is off by no more than the rounding error.
fn factor_of_covariance(row: u32) -> Factor {
  let first = triple_of(SHAPES, ingest.shapes, row, 0u);
  var last = triple_of(SHAPES, ingest.shapes, row, select(3u, 4u, ingest.shape_numbers == 9u));
  if (ingest.shape_numbers == 9u) { last.z = bits_of(SHAPES, ingest.shapes, row, 8u); }
  if (!are_finite(first) || !are_finite(last)) { return no_factor(); }
  let a = bitcast<vec3f>(first);
  let b = bitcast<vec3f>(last);
  let variances = max(vec3f(a.x, b.x, b.z), vec3f(0.0));
  let sigmas = sqrt(variances);
  let xx = sigmas.x;
  let yx = clamp(ratio(a.y, xx), -sigmas.y, sigmas.y);
  let zx = clamp(ratio(a.z, xx), -sigmas.z, sigmas.z);
  let yy = sqrt(max(variances.y - yx * yx, 0.0));
  let rest = max(variances.z - zx * zx, 0.0);
  let room = sqrt(rest);
  let zy = clamp(ratio(b.y - zx * yx, yy), -room, room);
  return Factor(vec3f(xx, yx, zx), vec2f(yy, zy), sqrt(max(rest - zy * zy, 0.0)), true);
}

// The same from rotation and scales: the rows of R S are orthogonalized one after the other, as in pack/factor.ts of
// the renderer, so that needles keep the digits that a covariance would lose.
fn factor_of_axes(row: u32) -> Factor {
  var scale_bits = vec3u(bits_of(SHAPES, ingest.shapes, row, 0u));
  if (ingest.shape_numbers == 3u) { scale_bits = triple_of(SHAPES, ingest.shapes, row, 0u); }
  let is_log = ingest.shape_kind == SHAPE_LOG_SCALE;
  // The logarithm of a scale of 0 is -infinity.
  let is_flat = (scale_bits == vec3u(0xff800000u)) & vec3<bool>(is_log);
  if (!are_finite(select(scale_bits, vec3u(0u), is_flat))) { return no_factor(); }
  let written = bitcast<vec3f>(select(scale_bits, vec3u(0u), is_flat));
  let scales = select(select(written, exp(min(written, vec3f(LARGEST_LOG))), is_log), vec3f(0.0), is_flat);
  let head = triple_of(ROTATIONS, ingest.rotations, row, 0u);
  let tail = bits_of(ROTATIONS, ingest.rotations, row, 3u);
  if (!has_finite_bits(vec4u(head, tail)) || any(scales < vec3f(0.0))) { return no_factor(); }
  var q = bitcast<vec4f>(vec4u(head, tail));
  if (ingest.is_w_first != 0u) { q = q.yzwx; }
  return factor_of(q, scales);
}

struct Opacity {
  value: f32,
  usable: bool,
}

fn opacity_of(row: u32) -> Opacity {
  let written = bits_of(OPACITIES, ingest.opacities, row, 0u);
  let is_finite = (written & EXPONENT_BITS) != EXPONENT_BITS;
  if (ingest.is_logit == 0u) { return Opacity(clamp(bitcast<f32>(select(0u, written, is_finite)), 0.0, 1.0), is_finite); }
  // Infinite logits are opacities of exactly 0 and 1.
  if (!is_finite) { return Opacity(select(1.0, 0.0, written == 0xff800000u), (written & 0x007fffffu) == 0u); }
  let logit = clamp(bitcast<f32>(written), -LARGEST_LOG, LARGEST_LOG);
  return Opacity(1.0 / (1.0 + exp(-logit)), true);
}

// Bits of number k of the harmonics of a row, in the order [coefficient][channel].
fn harmonic(row: u32, k: u32, coefficients: u32) -> u32 {
  switch ingest.color_kind {
    case COLOR_RGB: {
      let written = bits_of(COLORS, ingest.colors, row, k);
      if ((written & EXPONENT_BITS) == EXPONENT_BITS) { return written; }
      return bitcast<u32>((bitcast<f32>(written) - 0.5) / SH_C0);
    }
    case COLOR_COEFFICIENT_MAJOR: { return bits_of(COLORS, ingest.colors, row, k); }
    default: { return bits_of(COLORS, ingest.colors, row, (k % 3u) * coefficients + k / 3u); }
  }
}

// Packs the harmonics of a row as float16; false if one of them is not finite.
fn pack_harmonics(row: u32) -> bool {
  let coefficients = (ingest.sh_degree + 1u) * (ingest.sh_degree + 1u);
  let words = sh_stride(ingest.sh_degree, SH_FLOAT16);
  var usable = true;
  for (var word = 0u; word < words; word++) {
    var numbers = vec4u(0u);
    for (var k = 0u; k < 4u; k++) {
      if (4u * word + k < 3u * coefficients) { numbers[k] = harmonic(row, 4u * word + k, coefficients); }
    }
    usable = usable && has_finite_bits(numbers);
    let values = clamp(bitcast<vec4f>(select(vec4u(0u), numbers, has_finite_bits(numbers))), vec4f(-HALF_MAX), vec4f(HALF_MAX));
    sh[row * words + word] = vec2u(pack2x16float(values.xy), pack2x16float(values.zw));
  }
  return usable;
}

// Packs a live row and records its bounds.
fn ingest_row(row: u32, lane: u32) -> PackedGaussian {
  let nothing = PackedGaussian(vec4u(0u), vec4u(0u));
  let position = triple_of(POSITIONS, ingest.positions, row, 0u);
  let opacity = opacity_of(row);
  var factor: Factor;
  if (ingest.shape_kind == SHAPE_COVARIANCE) { factor = factor_of_covariance(row); } else { factor = factor_of_axes(row); }
  let has_color = pack_harmonics(row);
  if (!(are_finite(position) && opacity.usable && factor.usable && has_color)) { return nothing; }
  let packed = pack_gaussian(position, factor, opacity.value);
  if (!is_usable(packed)) { return nothing; }
  note_reach(lane, bitcast<vec3f>(position), factor, opacity.value);
  return packed;
}

@compute @workgroup_size(CULL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let chunk = group_index(workgroup_id);
  let row = chunk * CULL_GROUP + lane;
  let living = min(u32(max(ingest.count, 0)), ingest.rows);
  note_nothing(lane);
  if (row < ingest.page_rows) {
    if (ingest.first_row + row < living) {
      gaussians[row] = ingest_row(row, lane);
    } else {
      gaussians[row] = unseen_gaussian();
    }
  }
  let bounds = chunk_of_group(lane);
  // The last row of workgroups may have threads beyond the last chunk.
  if (lane == 0u && chunk * CULL_GROUP < ingest.page_rows) { chunks[chunk] = bounds; }
}
