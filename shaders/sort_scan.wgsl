// Second third: for each digit the exclusive prefix sums of its counts over the blocks, and the total. A workgroup
// serves eight digits, one in each row of 32 threads.
#import shared/plan
#import shared/sort
#import shared/prefix

@group(0) @binding(0) var<storage, read> plan: Plan;
// [digit][block]
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> digit_totals: array<u32>;

const ROW_THREADS = 32u;
const DIGITS_PER_GROUP = PREFIX_THREADS / ROW_THREADS;
const BLOCKS_PER_THREAD = 8u;

var<workgroup> row_totals: array<u32, DIGITS_PER_GROUP>;

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let row = lane / ROW_THREADS;
  let digit = workgroup_id.x * DIGITS_PER_GROUP + row;
  let blocks = plan.sort_blocks;
  var carry = 0u;
  for (var start = 0u; start < blocks; start += ROW_THREADS * BLOCKS_PER_THREAD) {
    let first = start + (lane % ROW_THREADS) * BLOCKS_PER_THREAD;
    var own: array<u32, BLOCKS_PER_THREAD>;
    var sum = 0u;
    for (var k = 0u; k < BLOCKS_PER_THREAD; k++) {
      // Written in every round: a compiler was seen to keep a variable of the loop body from one round to the next.
      own[k] = 0u;
      if (first + k < blocks) { own[k] = counts[digit * blocks + first + k]; }
      sum += own[k];
    }
    let inclusive = inclusive_sum(sum, lane, ROW_THREADS);
    if (lane % ROW_THREADS == ROW_THREADS - 1u) { row_totals[row] = inclusive; }
    var running = carry + inclusive - sum;
    for (var k = 0u; k < BLOCKS_PER_THREAD; k++) {
      if (first + k < blocks) { counts[digit * blocks + first + k] = running; }
      running += own[k];
    }
    workgroupBarrier();
    carry += row_totals[row];
    workgroupBarrier();
  }
  if (lane % ROW_THREADS == 0u) { digit_totals[digit] = carry; }
}
