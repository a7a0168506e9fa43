// `sort_scatter` for software adapters, which run few threads sequentially: each thread moves a whole block, in its
// order.
#import shared/sort_scatter

@compute @workgroup_size(1)
fn main(@builtin(workgroup_id) workgroup_id: vec3u) {
  let block_id = group_index(workgroup_id);
  if (block_id >= plan.sort_blocks) { return; }
  // Index of the next key with each digit.
  var next: array<u32, DIGITS>;
  var smaller = 0u;
  for (var digit = 0u; digit < DIGITS; digit++) {
    next[digit] = smaller + block_offsets[block_id * DIGITS + digit];
    smaller += digit_totals[digit];
  }
  let end = min(block_id * SORT_BLOCK + SORT_BLOCK, plan.visible);
  for (var i = block_id * SORT_BLOCK; i < end; i++) {
    let key = keys_in[i];
    let digit = digit_of(key, digit_pass.shift);
    let place = next[digit];
    next[digit] = place + 1u;
    if (place >= plan.visible) { continue; }
    keys_out[place] = key;
    values_out[place] = value_of(i);
  }
}
