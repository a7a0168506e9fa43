// `cull` for software adapters, which run few threads sequentially: each thread tests 32 splats, and none waits for
// another.
#import shared/visibility
#import shared/group
#import shared/cull_stats

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<StoredGaussian>;
@group(0) @binding(2) var<storage, read_write> visible_bits: array<u32>;
// Cleared before this pass.
@group(0) @binding(3) var<storage, read_write> group_counts: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> cull_stats: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> chunk_shares: array<f32>;

@compute @workgroup_size(WORDS_PER_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let chunk = group_index(workgroup_id);
  if (chunk * CULL_GROUP >= view.splat_count) { return; }
  let group = view.first_group + chunk;
  let share = chunk_shares[group];
  if (share <= 0.0) { return; }
  let first = chunk * CULL_GROUP + lane * 32u;
  var bits = 0u;
  var nearest = 0xffffffffu;
  var farthest = 0u;
  var covered = 0u;
  for (var k = 0u; k < 32u && first + k < view.splat_count; k++) {
    let found = gaussian_at(first + k);
    if (!is_usable(found)) {
      atomicAdd(&cull_stats[UNUSABLE], 1u);
      continue;
    }
    let part = visible_part(found, share);
    if (part.depth > 0.0) {
      bits |= 1u << k;
      nearest = min(nearest, bitcast<u32>(part.depth));
      farthest = max(farthest, bitcast<u32>(part.depth));
      covered += part.covered;
    }
  }
  visible_bits[group * WORDS_PER_GROUP + lane] = bits;
  if (bits != 0u) {
    atomicAdd(&group_counts[group], countOneBits(bits));
    atomicMax(&cull_stats[NEAREST_INVERTED], ~nearest);
    atomicMax(&cull_stats[FARTHEST], farthest);
    atomicAdd(&cull_stats[COVERED], (covered + COVERED_UNIT / 2u) / COVERED_UNIT);
  }
}
