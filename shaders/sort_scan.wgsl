// Second third: for each digit the exclusive prefix sums of its counts over the blocks, and the total. A workgroup
// handles four neighboring digits: one vector.
#import shared/plan
#import shared/sort
#import shared/prefix_vectors

@group(0) @binding(0) var<storage, read> plan: Plan;
// [block][digit]
@group(0) @binding(1) var<storage, read_write> counts: array<vec4u>;
@group(0) @binding(2) var<storage, read_write> digit_totals: array<vec4u>;

const DIGITS_PER_GROUP = 4u;
const BLOCKS_PER_THREAD = 8u;

var<workgroup> step_total: vec4u;

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let blocks = plan.sort_blocks;
  var carry = vec4u(0u);
  for (var start = 0u; start < blocks; start += PREFIX_THREADS * BLOCKS_PER_THREAD) {
    let first = start + lane * BLOCKS_PER_THREAD;
    var own: array<vec4u, BLOCKS_PER_THREAD>;
    for (var k = 0u; k < BLOCKS_PER_THREAD; k++) {
      // Written in every iteration, because one compiler kept a variable of the loop body from one iteration to the
      // next.
      own[k] = vec4u(0u);
      if (first + k < blocks) { own[k] = counts[(first + k) * (DIGITS / DIGITS_PER_GROUP) + workgroup_id.x]; }
    }
    var sum = vec4u(0u);
    for (var k = 0u; k < BLOCKS_PER_THREAD; k++) { sum += own[k]; }
    let inclusive = inclusive_sums(sum, lane);
    if (lane == PREFIX_THREADS - 1u) { step_total = inclusive; }
    var running = carry + inclusive - sum;
    for (var k = 0u; k < BLOCKS_PER_THREAD; k++) {
      if (first + k < blocks) { counts[(first + k) * (DIGITS / DIGITS_PER_GROUP) + workgroup_id.x] = running; }
      running += own[k];
    }
    carry += workgroupUniformLoad(&step_total);
  }
  if (lane == 0u) { digit_totals[workgroup_id.x] = carry; }
}
