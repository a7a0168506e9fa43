// Lists the visible splats of a block in the order of the file: survivors[slot] = index of the splat among all blocks.
// The last, partly filled chunk of a block counts as a whole chunk.
#import shared/view
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
// One bit for each splat: two vectors for each group.
@group(0) @binding(1) var<storage, read> visible_bits: array<vec4u>;
@group(0) @binding(2) var<storage, read> group_offsets: array<u32>;
@group(0) @binding(3) var<storage, read_write> survivors: array<u32>;

const VECTORS_PER_GROUP = WORDS_PER_GROUP / 4u;

// Counts the bits set in the words of a vector before word `end`.
fn bits_before(words: vec4u, end: i32) -> u32 {
  return dot(select(vec4u(0u), countOneBits(words), vec4i(0, 1, 2, 3) < vec4i(end)), vec4u(1u));
}

@compute @workgroup_size(CULL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let chunk = group_index(workgroup_id);
  if (chunk * CULL_GROUP >= view.splat_count) { return; }
  let group = view.first_group + chunk;
  // The group has no survivors, as most groups of a scene that surrounds the camera.
  if (group_offsets[group] == group_offsets[group + 1u]) { return; }
  let low = visible_bits[VECTORS_PER_GROUP * group];
  let high = visible_bits[VECTORS_PER_GROUP * group + 1u];
  let word = lane / 32u;
  let own = select(low, high, word >= 4u)[word % 4u];
  let bit = 1u << (lane % 32u);
  if ((own & bit) == 0u) { return; }
  let before = bits_before(low, i32(word)) + bits_before(high, i32(word) - 4);
  let slot = group_offsets[group] + before + countOneBits(own & (bit - 1u));
  if (slot < arrayLength(&survivors)) { survivors[slot] = group * CULL_GROUP + lane; }
}
