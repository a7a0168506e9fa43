// Second third: for one digit a workgroup, the exclusive prefix sums of its counts over the blocks, and the total.
#import shared/plan
#import shared/sort

@group(0) @binding(0) var<storage, read> plan: PlanView;
// [digit][block]
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> digit_totals: array<u32>;

var<workgroup> sums: array<u32, SORT_THREADS>;
var<workgroup> block_count: u32;

@compute @workgroup_size(SORT_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let digit = workgroup_id.x;
  if (lane == 0u) { block_count = plan.sort_blocks; }
  let blocks = workgroupUniformLoad(&block_count);
  var carry = 0u;
  for (var start = 0u; start < blocks; start += SORT_THREADS) {
    let block_id = start + lane;
    var own = 0u;
    if (block_id < blocks) { own = counts[digit * blocks + block_id]; }
    sums[lane] = own;
    for (var reach = 1u; reach < SORT_THREADS; reach *= 2u) {
      workgroupBarrier();
      let left = select(0u, sums[lane - min(reach, lane)], lane >= reach);
      workgroupBarrier();
      sums[lane] += left;
    }
    workgroupBarrier();
    if (block_id < blocks) { counts[digit * blocks + block_id] = carry + sums[lane] - own; }
    carry += sums[SORT_THREADS - 1u];
    workgroupBarrier();
  }
  if (lane == 0u) { digit_totals[digit] = carry; }
}
