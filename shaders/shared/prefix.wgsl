// Prefix sums over the 256 threads of a workgroup: doubling steps that alternate between two halves of one array, with
// one barrier in each step.
#import shared/saturating

const PREFIX_THREADS = 256u;

var<workgroup> scan: array<u32, 2u * PREFIX_THREADS>;

// Sum of `own` over all threads of the same row up to and including this one; rows are `width` threads wide (a power of
// two). Must be called by all threads. Ends with a barrier, so another call may follow.
fn inclusive_sum(own: u32, lane: u32, width: u32) -> u32 {
  let column = lane % width;
  var sum = own;
  var side = 0u;
  for (var reach = 1u; reach < width; reach *= 2u) {
    scan[side + lane] = sum;
    workgroupBarrier();
    if (column >= reach) { sum = add_saturating(sum, scan[side + lane - reach]); }
    side = PREFIX_THREADS - side;
  }
  workgroupBarrier();
  return sum;
}
