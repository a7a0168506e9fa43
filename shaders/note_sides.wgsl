// Notes which splats of a page showed from one side of the scene, after a picture from there: those of which some pixel had enough, and those that lie outside of the
// widest picture, of which nothing is known.
#import shared/projection
#import shared/packed_gaussian
#import shared/group
#import shared/sides

struct Side {
  // Bit of the side, and the word that it is in.
  bit: u32,
  word: u32,
  // Least weight, alpha times transmittance, that shows.
  least_weight: f32,
  // 1 for the widest picture.
  is_widest: u32,
}

const SIDE_GROUP = 64u;

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> side: Side;
@group(0) @binding(2) var<storage, read> gaussians: array<PackedGaussian>;
// The largest weight of each splat of the page; zero again afterwards, for the next picture.
@group(0) @binding(3) var<storage, read_write> weights: array<f32>;
@group(0) @binding(4) var<storage, read_write> seen_from: array<u32>;

@compute @workgroup_size(SIDE_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * SIDE_GROUP + lane;
  if (i >= view.splat_count) { return; }
  let weight = weights[i];
  weights[i] = 0.0;
  let g = unpack_gaussian(gaussians[i]);
  let depth = in_camera(view, g.position).z;
  let e = project_ellipse(view, g);
  let is_in_picture = depth >= view.near && all(e.center >= vec2f(0.0)) && all(e.center < view.viewport);
  // A splat smaller than a pixel is paler here than from nearby: where the scene is antialiased, its opacity makes up for its area.
  let paleness = min(1.0, e.opacity / max(g.opacity, 1e-30));
  let shows = weight > 0.0 && weight >= side.least_weight * paleness;
  if (shows || (side.is_widest != 0u && !is_in_picture)) {
    seen_from[side_word(arrayLength(&seen_from), side.word, i)] |= side.bit;
  }
}
