// Applies a cut to a block of a scene: removed splats become transparent, and splats that keep fewer bands take their
// refitted coefficients. `reduce` of the package makes the same choice on the CPU.
#import shared/transparent
#import shared/sh
#import shared/group
#import shared/score

struct Cut {
  splat_count: u32,
  sh_degree: u32,
  // Splats below either bound are removed.
  min_contribution: f32,
  removal_price: f32,
  // Mean squared error that storing one coefficient is worth.
  color_price: f32,
}

@group(0) @binding(0) var<uniform> cut: Cut;
@group(0) @binding(1) var<storage, read> gaussians: array<PackedGaussian>;
// float16, two in each word.
@group(0) @binding(2) var<storage, read> sh: array<u32>;
@group(0) @binding(3) var<storage, read> scores: array<Score>;
// See optimize_lower.
@group(0) @binding(4) var<storage, read> lowered: array<f32>;
@group(0) @binding(5) var<storage, read_write> cut_gaussians: array<PackedGaussian>;
@group(0) @binding(6) var<storage, read_write> cut_sh: array<u32>;
// Number of splats that stay, by the degree that they keep.
@group(0) @binding(7) var<storage, read_write> kept: array<atomic<u32>, 4>;

// The degree that each splat keeps, or GONE.
@group(0) @binding(8) var<storage, read_write> choices: array<u32>;

const GONE = 4u;

var<workgroup> kept_here: array<atomic<u32>, 4>;

fn coefficients(degree: u32) -> u32 {
  return (degree + 1u) * (degree + 1u);
}

// The degree that minimizes the error plus the price of the kept coefficients.
fn degree_of(i: u32) -> u32 {
  var best = cut.sh_degree;
  if (cut.color_price <= 0.0) { return best; }
  let record = i * lowered_numbers(cut.sh_degree, cut.sh_degree);
  var lowest = cut.color_price * f32(coefficients(best));
  for (var degree = 0u; degree < cut.sh_degree; degree++) {
    let cost = lowered[record + degree] + cut.color_price * f32(coefficients(degree));
    if (cost > lowest) { continue; }
    best = degree;
    lowest = cost;
  }
  return best;
}

// Rounds to the nearest float16 of the normal range, because packing is allowed to truncate.
fn nearest_half(value: f32) -> f32 {
  let value_bits = bitcast<u32>(value);
  return bitcast<f32>((value_bits + 0xfffu + ((value_bits >> 13u) & 1u)) & 0xffffe000u);
}

// Number `n` of the coefficients of a lower degree, which start at `first`; `numbers` is their count.
fn lowered_number(first: u32, n: u32, numbers: u32) -> f32 {
  if (n >= numbers) { return 0.0; }
  return nearest_half(lowered[first + n]);
}

fn write_color(i: u32, degree: u32) {
  let words = 2u * sh_stride(cut.sh_degree, SH_FLOAT16);
  let first = words * i;
  if (degree == cut.sh_degree) {
    for (var k = 0u; k < words; k++) { cut_sh[first + k] = sh[first + k]; }
    return;
  }
  let numbers = 3u * coefficients(degree);
  let source = i * lowered_numbers(cut.sh_degree, cut.sh_degree) + lowered_numbers(cut.sh_degree, degree);
  for (var k = 0u; k < words; k++) {
    let pair = vec2f(lowered_number(source, 2u * k, numbers), lowered_number(source, 2u * k + 1u, numbers));
    cut_sh[first + k] = pack2x16float(pair);
  }
}

fn apply(i: u32) {
  let s = scores[i];
  let g = gaussians[i];
  let goes = s.contribution < cut.min_contribution || s.removal < cut.removal_price;
  if (goes) {
    choices[i] = GONE;
    cut_gaussians[i] = transparent(g);
    return;
  }
  cut_gaussians[i] = g;
  let degree = degree_of(i);
  choices[i] = degree;
  write_color(i, degree);
  atomicAdd(&kept_here[degree], 1u);
}

@compute @workgroup_size(SCORE_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  if (lane < 4u) { atomicStore(&kept_here[lane], 0u); }
  workgroupBarrier();
  let i = group_index(workgroup_id) * SCORE_GROUP + lane;
  if (i < cut.splat_count) { apply(i); }
  workgroupBarrier();
  if (lane < 4u) { atomicAdd(&kept[lane], atomicLoad(&kept_here[lane])); }
}
