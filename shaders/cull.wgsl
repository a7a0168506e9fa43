// Which splats of a page paint anything: one thread per splat, one bit of `visible_bits` per splat, and the number of
// visible splats of each group of 256. Bits and counts, not atomic slots, so that compaction keeps the file's order and
// equal depths never flicker.
#import shared/projection
#import shared/group
#import shared/plan

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<PackedGaussian>;
@group(0) @binding(2) var<storage, read_write> visible_bits: array<u32>;
@group(0) @binding(3) var<storage, read_write> group_counts: array<u32>;
@group(0) @binding(4) var<storage, read_write> plan: Plan;

var<workgroup> bits: array<atomic<u32>, WORDS_PER_GROUP>;

fn is_visible(packed: PackedGaussian) -> bool {
  let g = unpack_gaussian(packed);
  // The cheap tests first: most splats of a scene fail one of them.
  let depth = (view.local_to_camera * vec4f(g.position, 1.0)).z;
  if (g.opacity < ALPHA_MIN || !is_in_depth_range(view, depth)) { return false; }
  return covers_a_pixel(view, project_ellipse(view, g));
}

@compute @workgroup_size(CULL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let group = group_index(workgroup_id);
  let i = group * CULL_GROUP + lane;
  if (i < view.splat_count) {
    let packed = gaussians[i];
    if (!is_usable(packed)) {
      atomicAdd(&plan.unusable, 1u);
    } else if (is_visible(packed)) {
      atomicOr(&bits[lane / 32u], 1u << (lane % 32u));
    }
  }
  workgroupBarrier();
  let words = (view.splat_count + CULL_GROUP - 1u) / CULL_GROUP;
  if (group >= words) { return; }
  if (lane < WORDS_PER_GROUP) {
    visible_bits[(view.first_group + group) * WORDS_PER_GROUP + lane] = atomicLoad(&bits[lane]);
  }
  if (lane == 0u) {
    var count = 0u;
    for (var w = 0u; w < WORDS_PER_GROUP; w++) { count += countOneBits(atomicLoad(&bits[w])); }
    group_counts[view.first_group + group] = count;
  }
}
