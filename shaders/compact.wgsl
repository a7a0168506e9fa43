// Lists the visible splats of a page in the file's order: survivors[slot] = index within the page.
#import shared/view
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> visible_bits: array<u32>;
@group(0) @binding(2) var<storage, read> group_offsets: array<u32>;
@group(0) @binding(3) var<storage, read_write> survivors: array<u32>;

@compute @workgroup_size(CULL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * CULL_GROUP + lane;
  if (i >= view.splat_count) { return; }
  let group = view.first_group + group_index(workgroup_id);
  let word = lane / 32u;
  let own = visible_bits[group * WORDS_PER_GROUP + word];
  let bit = 1u << (lane % 32u);
  if ((own & bit) == 0u) { return; }
  var slot = group_offsets[group] + countOneBits(own & (bit - 1u));
  for (var w = 0u; w < word; w++) { slot += countOneBits(visible_bits[group * WORDS_PER_GROUP + w]); }
  if (slot < arrayLength(&survivors)) { survivors[slot] = i; }
}
