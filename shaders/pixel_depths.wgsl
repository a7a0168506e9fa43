// Computes how the depth of each survivor of a block changes from pixel to pixel. Runs between `project` and the sort.
#import shared/projection
#import shared/stored_gaussian
#import shared/cull_stats
#import shared/plan
#import shared/group
#import shared/densest

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<StoredGaussian>;
@group(0) @binding(2) var<storage, read> survivors: array<u32>;
@group(0) @binding(3) var<storage, read> plan: Plan;
@group(0) @binding(4) var<storage, read> cull_stats: array<u32>;
// By slot.
@group(0) @binding(5) var<storage, read_write> pixel_depths: array<PixelDepth>;
@group(0) @binding(6) var<storage, read_write> keys: array<u32>;

// A splat is listed ahead of its center by this many standard deviations of its depth over the screen. A splat that
// comes too late for a pixel's window is blended too late; one that comes too early waits in the window.
const AHEAD = 0.5;

// True to replace the depth keys of the survivors, for an order by the depths at pixels.
override sets_keys: bool = true;

// Same as `depth_key` of `project`, for depths that may lie in front of the nearest center.
fn ahead_key(depth: f32) -> u32 {
  let depth_bits = bitcast<u32>(max(depth, 0.0));
  if (view.key_bits == 32u) { return depth_bits; }
  let margin = MARGIN_OCTAVES << OCTAVE_BITS;
  let nearest = max(~cull_stats[NEAREST_INVERTED], margin) - margin;
  let range = f32(max(cull_stats[FARTHEST] - nearest, 1u));
  let share = f32(max(depth_bits, nearest) - nearest) / range;
  return u32(min(share, 1.0) * f32((1u << view.key_bits) - 1u));
}

@compute @workgroup_size(PROJECT_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let page = plan.pages[view.page];
  let rank = group_index(workgroup_id) * PROJECT_GROUP + lane;
  if (rank >= page.survivors) { return; }
  let slot = page.first_slot + rank;
  let found = pixel_depth_of(view, unpack_gaussian(gaussian_at(survivors[slot] - view.first_group * CULL_GROUP)), view.filter_variance);
  pixel_depths[slot] = found.depth;
  if (sets_keys) { keys[slot] = ahead_key(found.center - AHEAD * found.spread); }
}
