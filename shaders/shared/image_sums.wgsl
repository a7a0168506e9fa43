// Sums over the 256 threads of a workgroup by halving, so that numbers of similar magnitude are added: sums of squares,
// and counts.
const SUM_THREADS = 256u;

var<workgroup> halves: array<vec2f, SUM_THREADS>;

// The sum of `own` over all threads, for the first one. Must be called by all.
fn sum_of_all(own: vec2f, lane: u32) -> vec2f {
  halves[lane] = own;
  workgroupBarrier();
  for (var reach = SUM_THREADS / 2u; reach > 0u; reach /= 2u) {
    if (lane < reach) { halves[lane] += halves[lane + reach]; }
    workgroupBarrier();
  }
  return halves[0];
}
