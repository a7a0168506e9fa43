// Projects the survivors of a block: screen ellipse, color from spherical harmonics, and the depth key of the sort.
#import shared/projection
#import shared/stored_gaussian
#import shared/sh_color
#import shared/splat
#import shared/cull_stats
#import shared/plan
#import shared/group
#import shared/detail
#import shared/scene_opacity

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<StoredGaussian>;
@group(0) @binding(2) var<storage, read> sh: array<vec2u>;
@group(0) @binding(3) var<storage, read> survivors: array<u32>;
@group(0) @binding(4) var<storage, read> plan: Plan;
@group(0) @binding(5) var<storage, read> cull_stats: array<u32>;
@group(0) @binding(6) var<storage, read_write> splats: array<ProjectedSplat>;
// Depth keys.
@group(0) @binding(7) var<storage, read_write> keys: array<u32>;
@group(0) @binding(8) var<storage, read> chunk_shares: array<f32>;

fn sh_word(i: u32) -> vec2u {
  return sh[i];
}

// Monotonic in the depth. The bits of a positive float32, read as an integer, grow like its logarithm, so their
// fraction of the visible range is a logarithmic key without a logarithm.
fn depth_key(depth: f32) -> u32 {
  let depth_bits = bitcast<u32>(depth);
  if (view.key_bits >= 32u) { return depth_bits; }
  let nearest = ~cull_stats[NEAREST_INVERTED];
  let range = f32(max(cull_stats[FARTHEST] - nearest, 1u));
  // A recomputed depth may round to less than the nearest one.
  let share = f32(max(depth_bits, nearest) - nearest) / range;
  return u32(min(share, 1.0) * f32((1u << view.key_bits) - 1u));
}

// If the splats cover the image more often than the limit allows, drops those that cover more than an equal portion, so
// that the rest stays within the limit.
fn is_left_out(e: Ellipse) -> bool {
  if (cull_stats[COVERED] <= view.max_covered) { return false; }
  let part = f32(COVERED_UNIT) * f32(view.max_covered) / f32(max(plan.visible, 1u));
  return f32(covered_share(view, e, covered_box(view, e))) > part;
}

@compute @workgroup_size(PROJECT_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let page = plan.pages[view.page];
  let rank = group_index(workgroup_id) * PROJECT_GROUP + lane;
  if (rank >= page.survivors) { return; }
  let slot = page.first_slot + rank;
  let i = survivors[slot] - view.first_group * CULL_GROUP;
  var g = unpack_gaussian(gaussian_at(i));
  g.opacity = shared_opacity(thinned_opacity(g.opacity, view.opacity), chunk_shares[view.first_group + i / CULL_GROUP]);
  var e = project_ellipse(view, g);
  if (is_left_out(e)) { e.opacity = 0.0; }
  let toward = select(g.position - view.eye, view.axis, view.is_orthographic != 0u);
  let color = splat_sh_color(i, normalize(toward));
  splats[slot] = pack_splat(e, color);
  // In units of the world, which all scenes share.
  keys[slot] = depth_key(select(e.depth, length(in_camera(view, g.position)), view.key_bits > 32u));
}
