// `sort_scan` for software adapters, which run few threads sequentially: each thread sums a whole digit.
#import shared/plan
#import shared/sort

@group(0) @binding(0) var<storage, read> plan: Plan;
// [block][digit]
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> digit_totals: array<u32>;

const DIGITS_PER_SERIAL_GROUP = 8u;

@compute @workgroup_size(DIGITS_PER_SERIAL_GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
  var sum = 0u;
  for (var b = 0u; b < plan.sort_blocks; b++) {
    let i = b * DIGITS + id.x;
    let own = counts[i];
    counts[i] = sum;
    sum += own;
  }
  digit_totals[id.x] = sum;
}
