// Adds one view to the scores of the splats of a block, from the largest weights that the tiles have recorded. The
// energy of a splat is the sum of its squared weights over the pixels of the image; it is computed for an ellipse of
// that peak and of the projected size.
#import shared/projection
#import shared/packed_gaussian
#import shared/group
#import shared/score

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<PackedGaussian>;
// Largest weights in this view; cleared afterwards for the next one.
@group(0) @binding(2) var<storage, read_write> peaks: array<f32>;
// The row of this view.
@group(0) @binding(3) var<storage, read_write> energies: array<f32>;
@group(0) @binding(4) var<storage, read_write> scores: array<Score>;

const PI = 3.14159265358979;

@compute @workgroup_size(SCORE_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * SCORE_GROUP + lane;
  if (i >= view.splat_count) { return; }
  let peak = peaks[i];
  peaks[i] = 0.0;
  let g = unpack_gaussian(gaussians[i]);
  let depth = in_camera(view, g.position).z;
  let e = project_ellipse(view, g);
  var energy = 0.0;
  if (peak > 0.0) {
    // The integral of exp(-(u² + v²)).
    let area = PI * e.sigma_x * e.sigma_v;
    energy = peak * peak * min(1.0, area / (view.viewport.x * view.viewport.y));
  }
  energies[i] = energy;
  var s = scores[i];
  let is_in_frame = depth >= view.near && all(e.center >= vec2f(0.0)) && all(e.center < view.viewport);
  s.contribution = max(s.contribution, peak);
  s.removal = max(s.removal, energy);
  s.energy += energy;
  s.looks += select(0u, 1u, is_in_frame);
  scores[i] = s;
}
