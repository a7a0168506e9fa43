// `sort_count` for software adapters, which run few threads sequentially: each thread counts a whole block.
#import shared/plan
#import shared/group
#import shared/sort

@group(0) @binding(0) var<uniform> digit_pass: SortPass;
@group(0) @binding(1) var<storage, read> plan: Plan;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
// [block][digit]
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

@compute @workgroup_size(1)
fn main(@builtin(workgroup_id) workgroup_id: vec3u) {
  let block_id = group_index(workgroup_id);
  if (block_id >= plan.sort_blocks) { return; }
  var histogram: array<u32, DIGITS>;
  let end = min(block_id * SORT_BLOCK + SORT_BLOCK, plan.visible);
  for (var i = block_id * SORT_BLOCK; i < end; i++) {
    histogram[digit_of(keys[i], digit_pass.shift)]++;
  }
  for (var digit = 0u; digit < DIGITS; digit++) { counts[block_id * DIGITS + digit] = histogram[digit]; }
}
