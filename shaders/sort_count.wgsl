// First third of a stable radix sort pass: how often each digit occurs in each block of keys.
#import shared/plan
#import shared/group
#import shared/sort

@group(0) @binding(0) var<uniform> digit_pass: SortPass;
@group(0) @binding(1) var<storage, read> plan: Plan;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
// [block][digit]
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

var<workgroup> histogram: array<atomic<u32>, DIGITS>;

@compute @workgroup_size(SORT_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let block_id = group_index(workgroup_id);
  if (block_id >= plan.sort_blocks) { return; }
  let first = block_id * SORT_BLOCK + lane;
  // All loads are issued before the first key is counted.
  var own: array<u32, SORT_BLOCK / SORT_THREADS>;
  for (var r = 0u; r < SORT_BLOCK / SORT_THREADS; r++) {
    let i = first + r * SORT_THREADS;
    if (i < plan.visible) { own[r] = keys[i]; }
  }
  for (var r = 0u; r < SORT_BLOCK / SORT_THREADS; r++) {
    if (first + r * SORT_THREADS < plan.visible) { atomicAdd(&histogram[digit_of(own[r], digit_pass.shift)], 1u); }
  }
  workgroupBarrier();
  counts[block_id * DIGITS + lane] = atomicLoad(&histogram[lane]);
}
