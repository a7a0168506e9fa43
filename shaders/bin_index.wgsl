// Where each bin begins and ends among the pairs, once they are sorted by bin; and for each tile of a bin a bit for each pair, so that
// a tile finds the few that touch it without reading the others.
#import shared/bins
#import shared/plan
#import shared/group

@group(0) @binding(0) var<storage, read> pair_plan: Plan;
// Bins of the sorted pairs.
@group(0) @binding(1) var<storage, read> bins: array<u32>;
@group(0) @binding(2) var<storage, read> pairs: array<vec2u>;
// First pair of each bin and the one behind the last; equal where a bin is empty.
@group(0) @binding(3) var<storage, read_write> ranges: array<vec2u>;
// See tile_word.
@group(0) @binding(4) var<storage, read_write> tile_bits: array<u32>;

// Rows of 32 masks, one word apart, so that threads that read a column each meet other banks of the memory.
const MASK_ROW = 33u;
var<workgroup> masks: array<u32, MASK_ROW * PAIR_WORDS>;

@compute @workgroup_size(PROJECT_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let first = group_index(workgroup_id) * PROJECT_GROUP;
  let i = first + lane;
  var mask = 0u;
  if (i < pair_plan.visible) {
    mask = pairs[i].y;
    let bin = bins[i];
    if (i == 0u || bins[i - 1u] != bin) { ranges[bin].x = i; }
    if (i == pair_plan.visible - 1u || bins[i + 1u] != bin) { ranges[bin].y = i + 1u; }
  }
  masks[MASK_ROW * (lane / 32u) + lane % 32u] = mask;
  workgroupBarrier();
  if (first >= pair_plan.visible) { return; }
  // Thread lane writes word lane of the group: of this tile, for these 32 pairs.
  let tile = lane / PAIR_WORDS;
  let row = MASK_ROW * (lane % PAIR_WORDS);
  var word = 0u;
  for (var k = 0u; k < 32u; k++) { word |= ((masks[row + k] >> tile) & 1u) << k; }
  tile_bits[first + lane] = word;
}
