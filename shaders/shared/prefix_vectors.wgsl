// Prefix sums of four numbers at once over the threads of a workgroup: shared/prefix for vectors.
#import shared/prefix

fn add_vectors_saturating(a: vec4u, b: vec4u) -> vec4u {
  let sum = a + b;
  return select(sum, vec4u(0xffffffffu), sum < a);
}

var<workgroup> vector_scan: array<vec4u, 2u * PREFIX_THREADS>;

// Sum of `own` over all threads up to and including this one. Must be called by all threads. Ends with a barrier, so
// another call may follow.
fn inclusive_sums(own: vec4u, lane: u32) -> vec4u {
  var sum = own;
  var side = 0u;
  for (var reach = 1u; reach < PREFIX_THREADS; reach *= 2u) {
    vector_scan[side + lane] = sum;
    workgroupBarrier();
    if (lane >= reach) { sum = add_vectors_saturating(sum, vector_scan[side + lane - reach]); }
    side = PREFIX_THREADS - side;
  }
  workgroupBarrier();
  return sum;
}
