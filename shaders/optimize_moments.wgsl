// Adds some views to the moments of the splats of a block: products of basis functions in the direction of each view,
// weighted by the energy of the splat in it.
#import shared/packed_gaussian
#import shared/moments
#import shared/group
#import shared/score

struct MomentViews {
  splat_count: u32,
  // Stride between rows of `energies` or `moments`.
  row: u32,
  // The number of views in this batch, one row of `energies` each, and the index of their first eye.
  views: u32,
  first_view: u32,
  sh_degree: u32,
}

@group(0) @binding(0) var<uniform> seen: MomentViews;
// Eyes of the views, in block-local coordinates.
@group(0) @binding(1) var<storage, read> eyes: array<vec4f>;
@group(0) @binding(2) var<storage, read> gaussians: array<PackedGaussian>;
@group(0) @binding(3) var<storage, read> energies: array<f32>;
@group(0) @binding(4) var<storage, read_write> moments: array<f32>;

var<private> basis: array<f32, MAX_COEFFICIENTS>;

fn load_basis(d: vec3f, size: u32) {
  for (var q = 0u; 4u * q < size; q++) {
    let values = sh_basis(q, d);
    for (var k = 0u; k < 4u; k++) { basis[4u * q + k] = values[k]; }
  }
}

@compute @workgroup_size(SCORE_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * SCORE_GROUP + lane;
  if (i >= seen.splat_count) { return; }
  let size = (seen.sh_degree + 1u) * (seen.sh_degree + 1u);
  let position = unpack_gaussian(gaussians[i]).position;
  for (var k = 0u; k < at(size, 0u); k++) { matrix[k] = 0.0; }
  for (var v = 0u; v < seen.views; v++) {
    let energy = energies[v * seen.row + i];
    if (energy == 0.0) { continue; }
    load_basis(normalize(position - eyes[seen.first_view + v].xyz), size);
    var k = 0u;
    for (var row = 0u; row < size; row++) {
      let weight = energy * basis[row];
      for (var column = 0u; column <= row; column++) {
        matrix[k] += weight * basis[column];
        k++;
      }
    }
  }
  for (var k = 0u; k < at(size, 0u); k++) { moments[k * seen.row + i] += matrix[k]; }
}
