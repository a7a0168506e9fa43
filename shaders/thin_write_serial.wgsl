// `thin_write` for processors that run few threads one after the other: a thread lists a whole block.
#import shared/thin_order

// Exclusive prefix sums of the counts.
@group(0) @binding(3) var<storage, read> block_offsets: array<u32>;
@group(0) @binding(4) var<storage, read_write> survivors: array<u32>;

@compute @workgroup_size(BLOCKS_PER_SERIAL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let run = serial_block(workgroup_id, lane);
  if (run.y >= run.z) { return; }
  var slot = block_offsets[run.x];
  for (var word = run.y; word < run.z; word++) {
    let numbers = order[word];
    let flags = visible_flags(numbers);
    for (var k = 0u; k < 4u; k++) {
      if (flags[k] == 0u) { continue; }
      if (slot < arrayLength(&survivors)) { survivors[slot] = numbers[k]; }
      slot++;
    }
  }
}
