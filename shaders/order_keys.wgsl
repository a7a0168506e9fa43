// Keys that order all splats of a page by depth, those behind the camera included: the depth's bits, made to grow with it.
#import shared/view
#import shared/stored_gaussian
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<StoredGaussian>;
// By number among all splats, pages counted as whole chunks.
@group(0) @binding(2) var<storage, read_write> keys: array<u32>;

@compute @workgroup_size(CULL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = workgroup_id.x * CULL_GROUP + lane;
  // What fills up the last chunk goes behind everything; its bits are never set.
  var key = 0xffffffffu;
  if (i < view.splat_count) {
    let position = position_of(gaussian_at(i));
    let depth_bits = bitcast<u32>(in_camera(view, position).z);
    key = select(depth_bits | 0x80000000u, ~depth_bits, depth_bits >= 0x80000000u);
  }
  keys[view.first_group * CULL_GROUP + i] = key;
}
