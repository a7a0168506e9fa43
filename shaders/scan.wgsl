// Exclusive prefix sum of an array in place, by one workgroup that walks over it: no workgroup waits for another. Four values are read and
// written at a time, so that a thread's values lie in few memory transactions.
// values[length] receives the total; what follows it up to a whole vector is lost.
#import shared/prefix

@group(0) @binding(0) var<storage, read_write> values: array<vec4u>;
@group(0) @binding(1) var<uniform> scan: Scan;

struct Scan { length: u32 }

const PER_THREAD = 32u;
const VECTORS = PER_THREAD / 4u;

var<workgroup> step_total: u32;
// Sum up to and including each thread.
var<workgroup> ends: array<u32, PREFIX_THREADS>;

// The values of vector v, of which those behind the end count as 0.
fn values_of(v: u32) -> vec4u {
  if (4u * v >= scan.length) { return vec4u(0u); }
  let places = 4u * v + vec4u(0u, 1u, 2u, 3u);
  return select(vec4u(0u), values[v], places < vec4u(scan.length));
}

// What each component begins at, after `before`.
fn sums_before(before: u32, own: vec4u) -> vec4u {
  let y = add_saturating(before, own.x);
  let z = add_saturating(y, own.y);
  return vec4u(before, y, z, add_saturating(z, own.z));
}

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(local_invocation_index) lane: u32) {
  var carry = 0u;
  for (var start = 0u; start < scan.length; start += PREFIX_THREADS * PER_THREAD) {
    let first = start / 4u + lane * VECTORS;
    var own: array<vec4u, VECTORS>;
    // All are on their way before the first is added.
    for (var k = 0u; k < VECTORS; k++) { own[k] = values_of(first + k); }
    var sum = 0u;
    for (var k = 0u; k < VECTORS; k++) { sum = add_saturating(sums_before(sum, own[k]).w, own[k].w); }
    let inclusive = inclusive_sum(sum, lane, PREFIX_THREADS);
    if (lane == PREFIX_THREADS - 1u) { step_total = inclusive; }
    ends[lane] = inclusive;
    workgroupBarrier();
    // Not the difference of two sums: both may have stopped.
    var running = add_saturating(carry, select(ends[max(lane, 1u) - 1u], 0u, lane == 0u));
    for (var k = 0u; k < VECTORS; k++) {
      let sums = sums_before(running, own[k]);
      if (4u * (first + k) < scan.length) { values[first + k] = sums; }
      running = add_saturating(sums.w, own[k].w);
    }
    carry = add_saturating(carry, workgroupUniformLoad(&step_total));
  }
  storageBarrier();
  if (lane == 0u) { values[scan.length / 4u][scan.length % 4u] = carry; }
}
