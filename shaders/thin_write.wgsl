// Lists the visible splats of an order, in that order.
#import shared/thin

// Exclusive prefix sums of the counts.
@group(0) @binding(3) var<storage, read> block_offsets: array<u32>;
@group(0) @binding(4) var<storage, read_write> survivors: array<u32>;

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let start = run_start(workgroup_id, lane);
  var numbers: array<vec4u, 2>;
  var flags: array<vec4u, 2>;
  var own = 0u;
  for (var k = 0u; k < THIN_RUN / 4u; k++) {
    flags[k] = vec4u(0u);
    if (4u * (start + k) < thin.length) {
      numbers[k] = order[start + k];
      flags[k] = visible_flags(numbers[k]);
    }
    own += flags[k].x + flags[k].y + flags[k].z + flags[k].w;
  }
  let inclusive = inclusive_sum(own, lane, PREFIX_THREADS);
  let block_id = group_index(workgroup_id);
  if (block_id * THIN_BLOCK >= thin.length) { return; }
  var slot = block_offsets[block_id] + inclusive - own;
  for (var k = 0u; k < THIN_RUN; k++) {
    if (flags[k / 4u][k % 4u] != 0u) {
      if (slot < arrayLength(&survivors)) { survivors[slot] = numbers[k / 4u][k % 4u]; }
      slot++;
    }
  }
}
