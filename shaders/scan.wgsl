// Exclusive prefix sum of an array in place, by one workgroup that walks over it: no workgroup waits for another.
// values[length] receives the total.
#import shared/prefix

@group(0) @binding(0) var<storage, read_write> values: array<u32>;
@group(0) @binding(1) var<uniform> scan: Scan;

struct Scan { length: u32 }

const PER_THREAD = 16u;

var<workgroup> step_total: u32;
// Sum up to and including each thread.
var<workgroup> ends: array<u32, PREFIX_THREADS>;

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(local_invocation_index) lane: u32) {
  var carry = 0u;
  for (var start = 0u; start < scan.length; start += PREFIX_THREADS * PER_THREAD) {
    let first = start + lane * PER_THREAD;
    var own: array<u32, PER_THREAD>;
    var sum = 0u;
    for (var k = 0u; k < PER_THREAD; k++) {
      // Written in every round: a compiler was seen to keep a variable of the loop body from one round to the next.
      own[k] = 0u;
      if (first + k < scan.length) { own[k] = values[first + k]; }
      sum = add_saturating(sum, own[k]);
    }
    let inclusive = inclusive_sum(sum, lane, PREFIX_THREADS);
    if (lane == PREFIX_THREADS - 1u) { step_total = inclusive; }
    ends[lane] = inclusive;
    workgroupBarrier();
    // Not the difference of two sums: both may have stopped.
    var running = add_saturating(carry, select(ends[max(lane, 1u) - 1u], 0u, lane == 0u));
    for (var k = 0u; k < PER_THREAD; k++) {
      if (first + k < scan.length) { values[first + k] = running; }
      running = add_saturating(running, own[k]);
    }
    carry = add_saturating(carry, workgroupUniformLoad(&step_total));
  }
  if (lane == 0u) { values[scan.length] = carry; }
}
