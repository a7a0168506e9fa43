// Exclusive prefix sum of an array in place, by one workgroup that walks over it: no workgroup waits for another.
// values[length] receives the total.
@group(0) @binding(0) var<storage, read_write> values: array<u32>;
@group(0) @binding(1) var<uniform> scan: Scan;

struct Scan { length: u32 }

const THREADS = 256u;
const PER_THREAD = 16u;

var<workgroup> sums: array<u32, THREADS>;

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) lane: u32) {
  var carry = 0u;
  for (var start = 0u; start < scan.length; start += THREADS * PER_THREAD) {
    let first = start + lane * PER_THREAD;
    var own: array<u32, PER_THREAD>;
    var sum = 0u;
    for (var k = 0u; k < PER_THREAD; k++) {
      if (first + k < scan.length) { own[k] = values[first + k]; }
      sum += own[k];
    }
    sums[lane] = sum;
    for (var reach = 1u; reach < THREADS; reach *= 2u) {
      workgroupBarrier();
      let left = select(0u, sums[lane - min(reach, lane)], lane >= reach);
      workgroupBarrier();
      sums[lane] += left;
    }
    workgroupBarrier();
    var running = carry + sums[lane] - sum;
    for (var k = 0u; k < PER_THREAD; k++) {
      if (first + k < scan.length) { values[first + k] = running; }
      running += own[k];
    }
    carry += sums[THREADS - 1u];
    workgroupBarrier();
  }
  if (lane == 0u) { values[scan.length] = carry; }
}
