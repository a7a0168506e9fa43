// Notes which splats of a page showed from one side of the scene: those of which some pixel of the pictures from there had enough, and those that lie
// outside of the pictures, of which nothing is known.
#import shared/gaussian
#import shared/group
#import shared/sides

struct Side {
  // Where the farthest picture is taken from, relative to the scene's origin, and the direction that it looks in.
  eye: vec3f,
  splat_count: u32,
  forward: vec3f,
  // Tangent of the angle to `forward` up to which it shows everything.
  tangent: f32,
  // Bit of the side, and the word that it is in.
  bit: u32,
  word: u32,
  // Least weight, alpha times transmittance, that shows.
  least_weight: f32,
}

const SIDE_GROUP = 64u;

@group(0) @binding(0) var<uniform> side: Side;
@group(0) @binding(1) var<storage, read> gaussians: array<PackedGaussian>;
// The largest weight of each splat of the page; zero again afterwards, for the next side.
@group(0) @binding(2) var<storage, read_write> weights: array<f32>;
@group(0) @binding(3) var<storage, read_write> seen_from: array<u32>;

@compute @workgroup_size(SIDE_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * SIDE_GROUP + lane;
  if (i >= side.splat_count) { return; }
  let away = bitcast<vec3f>(gaussians[i].head.xyz) - side.eye;
  let depth = dot(away, side.forward);
  let is_in_picture = length(away - depth * side.forward) <= side.tangent * depth;
  if (!is_in_picture || weights[i] >= side.least_weight) {
    seen_from[side_word(arrayLength(&seen_from), side.word, i)] |= side.bit;
  }
  weights[i] = 0.0;
}
