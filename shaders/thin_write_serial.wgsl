// `thin_write` for processors that run few threads one after the other: a thread lists a whole block.
#import shared/thin_order

// Exclusive prefix sums of the counts.
@group(0) @binding(3) var<storage, read> block_offsets: array<u32>;
@group(0) @binding(4) var<storage, read_write> survivors: array<u32>;

@compute @workgroup_size(BLOCKS_PER_SERIAL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let block_id = group_index(workgroup_id) * BLOCKS_PER_SERIAL_GROUP + lane;
  let start = block_id * THIN_BLOCK / 4u;
  let end = min(start + THIN_BLOCK / 4u, thin.length / 4u);
  if (start >= end) { return; }
  var slot = block_offsets[block_id];
  for (var word = start; word < end; word++) {
    let numbers = order[word];
    let flags = visible_flags(numbers);
    for (var k = 0u; k < 4u; k++) {
      if (flags[k] == 0u) { continue; }
      if (slot < arrayLength(&survivors)) { survivors[slot] = numbers[k]; }
      slot++;
    }
  }
}
