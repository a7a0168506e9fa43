// `thin_count` for processors that run few threads one after the other: a thread counts a whole block.
#import shared/thin_order

@group(0) @binding(3) var<storage, read_write> block_counts: array<u32>;

@compute @workgroup_size(BLOCKS_PER_SERIAL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let run = serial_block(workgroup_id, lane);
  if (run.y >= run.z) { return; }
  var sum = vec4u(0u);
  for (var word = run.y; word < run.z; word++) { sum += visible_flags(order[word]); }
  block_counts[run.x] = sum.x + sum.y + sum.z + sum.w;
}
