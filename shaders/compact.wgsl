// Lists the visible splats of a page in the file's order: survivors[slot] = number of the splat among all, pages and their
// last, partly filled chunks counted as whole chunks.
#import shared/view
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> chunk_list: array<u32>;
@group(0) @binding(2) var<storage, read> visible_bits: array<u32>;
@group(0) @binding(3) var<storage, read> group_offsets: array<u32>;
@group(0) @binding(4) var<storage, read_write> survivors: array<u32>;

@compute @workgroup_size(CULL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let group = view.first_group + chunk_list[view.first_group + workgroup_id.x];
  let word = lane / 32u;
  let own = visible_bits[group * WORDS_PER_GROUP + word];
  let bit = 1u << (lane % 32u);
  if ((own & bit) == 0u) { return; }
  var slot = group_offsets[group] + countOneBits(own & (bit - 1u));
  for (var w = 0u; w < word; w++) { slot += countOneBits(visible_bits[group * WORDS_PER_GROUP + w]); }
  if (slot < arrayLength(&survivors)) { survivors[slot] = group * CULL_GROUP + lane; }
}
