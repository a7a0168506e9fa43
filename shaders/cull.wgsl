// Which splats of the chunks at hand paint anything: one thread per splat, one bit of `visible_bits` per splat, and the number
// of visible splats of each group of 256. Bits and counts, not atomic slots, so that compaction keeps the file's order and
// equal depths never flicker.
#import shared/visibility
#import shared/group
#import shared/gathered

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<PackedGaussian>;
@group(0) @binding(2) var<storage, read> chunk_list: array<u32>;
@group(0) @binding(3) var<storage, read_write> visible_bits: array<u32>;
@group(0) @binding(4) var<storage, read_write> group_counts: array<u32>;
@group(0) @binding(5) var<storage, read_write> gathered: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read> chunk_shares: array<f32>;

// Splats of one part of a chunk: what one thread sums up.
const PART = 8u;
const PARTS = CULL_GROUP / PART;
const PARTS_PER_WORD = PARTS / WORDS_PER_GROUP;

// Bits of the camera depth of each splat that paints, 0 of others; parts lie one word apart, so that threads that read a part each meet other
// banks of the memory.
var<workgroup> depths: array<u32, CULL_GROUP + PARTS>;

// What is known of some splats: a bit for each that paints, and the range of their depths.
struct Seen {
  bits: u32,
  nearest_inverted: u32,
  farthest: u32,
}

var<workgroup> parts: array<Seen, PARTS>;
var<workgroup> words: array<Seen, WORDS_PER_GROUP>;

fn sum_up_part(part: u32) -> Seen {
  var seen = Seen();
  for (var k = 0u; k < PART; k++) {
    let depth = depths[(PART + 1u) * part + k];
    if (depth == 0u) { continue; }
    seen.bits |= 1u << k;
    seen.nearest_inverted = max(seen.nearest_inverted, ~depth);
    seen.farthest = max(seen.farthest, depth);
  }
  return seen;
}

fn sum_up_word(word: u32) -> Seen {
  var seen = Seen();
  for (var k = 0u; k < PARTS_PER_WORD; k++) {
    let part = parts[PARTS_PER_WORD * word + k];
    seen.bits |= part.bits << (PART * k);
    seen.nearest_inverted = max(seen.nearest_inverted, part.nearest_inverted);
    seen.farthest = max(seen.farthest, part.farthest);
  }
  return seen;
}

@compute @workgroup_size(CULL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let chunk = chunk_list[view.first_group + workgroup_id.x];
  let i = chunk * CULL_GROUP + lane;
  let share = chunk_shares[view.first_group + chunk];
  var depth = 0.0;
  if (i < view.splat_count) {
    let packed = gaussians[i];
    if (is_usable(packed)) { depth = visible_depth(packed, share); } else { atomicAdd(&gathered[UNUSABLE], 1u); }
  }
  // Not by atomics, which 256 threads would wait for one by one.
  depths[lane + lane / PART] = bitcast<u32>(depth);
  workgroupBarrier();
  if (lane < PARTS) { parts[lane] = sum_up_part(lane); }
  workgroupBarrier();
  let group = view.first_group + chunk;
  if (lane < WORDS_PER_GROUP) {
    let seen = sum_up_word(lane);
    words[lane] = seen;
    visible_bits[group * WORDS_PER_GROUP + lane] = seen.bits;
  }
  workgroupBarrier();
  if (lane != 0u) { return; }
  var count = 0u;
  var nearest_inverted = 0u;
  var farthest = 0u;
  for (var w = 0u; w < WORDS_PER_GROUP; w++) {
    count += countOneBits(words[w].bits);
    nearest_inverted = max(nearest_inverted, words[w].nearest_inverted);
    farthest = max(farthest, words[w].farthest);
  }
  group_counts[group] = count;
  if (count > 0u) {
    atomicMax(&gathered[NEAREST_INVERTED], nearest_inverted);
    atomicMax(&gathered[FARTHEST], farthest);
  }
}
