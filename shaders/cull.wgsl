// Finds the visible splats of the chunks that are drawn: one thread and one bit of `visible_bits` for each splat, and
// the number of visible splats of each group of 256. Bits and counts replace atomic slots, so that compaction keeps the
// order of the file and splats of equal depth never flicker.
#import shared/visibility
#import shared/group
#import shared/cull_stats

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<StoredGaussian>;
@group(0) @binding(2) var<storage, read_write> visible_bits: array<u32>;
@group(0) @binding(3) var<storage, read_write> group_counts: array<u32>;
@group(0) @binding(4) var<storage, read_write> cull_stats: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> chunk_shares: array<f32>;

var<workgroup> bits: array<atomic<u32>, WORDS_PER_GROUP>;
var<workgroup> nearest_inverted: atomic<u32>;
var<workgroup> farthest: atomic<u32>;
var<workgroup> covered: atomic<u32>;

@compute @workgroup_size(CULL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let chunk = group_index(workgroup_id);
  if (chunk * CULL_GROUP >= view.splat_count) { return; }
  let group = view.first_group + chunk;
  let share = chunk_shares[group];
  if (share <= 0.0) { return; }
  let i = chunk * CULL_GROUP + lane;
  if (i < view.splat_count) {
    let found = gaussian_at(i);
    if (!is_usable(found)) {
      atomicAdd(&cull_stats[UNUSABLE], 1u);
    } else {
      let part = visible_part(found, share);
      if (part.depth > 0.0) {
        atomicOr(&bits[lane / 32u], 1u << (lane % 32u));
        atomicMax(&nearest_inverted, ~bitcast<u32>(part.depth));
        atomicMax(&farthest, bitcast<u32>(part.depth));
        if (part.covered > 0u) { atomicAdd(&covered, part.covered); }
      }
    }
  }
  workgroupBarrier();
  if (lane < WORDS_PER_GROUP) { visible_bits[group * WORDS_PER_GROUP + lane] = atomicLoad(&bits[lane]); }
  if (lane == 0u) {
    var count = 0u;
    for (var w = 0u; w < WORDS_PER_GROUP; w++) { count += countOneBits(atomicLoad(&bits[w])); }
    group_counts[group] = count;
    if (count > 0u) {
      atomicMax(&cull_stats[NEAREST_INVERTED], atomicLoad(&nearest_inverted));
      atomicMax(&cull_stats[FARTHEST], atomicLoad(&farthest));
      let shares = (atomicLoad(&covered) + COVERED_UNIT / 2u) / COVERED_UNIT;
      if (shares > 0u) { atomicAdd(&cull_stats[COVERED], shares); }
    }
  }
}
