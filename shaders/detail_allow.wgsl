// Finds the lowest error threshold that keeps the splats of a frame within the budget. It is continuous in the counts:
// a bucket's count is an upper bound for the whole bucket, so the position within it follows the remaining budget.
#import shared/view
#import shared/detail_counts
#import shared/prefix

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> detail_counts: array<u32>;
// Only its last word is written.
@group(0) @binding(2) var<storage, read_write> chunk_shares: array<f32>;

var<workgroup> looked_at: array<u32, DETAIL_BUCKETS>;
// Index of the bucket after the last one that exceeds the budget.
var<workgroup> first_within: atomic<u32>;

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(local_invocation_index) lane: u32) {
  let more = inclusive_sum(detail_counts[lane], lane, PREFIX_THREADS);
  var ended = 0u;
  if (lane > 0u) { ended = detail_counts[DETAIL_BUCKETS + lane - 1u]; }
  let fewer = inclusive_sum(ended, lane, PREFIX_THREADS);
  looked_at[lane] = more - fewer;
  if (looked_at[lane] > view.splat_budget) { atomicMax(&first_within, lane + 1u); }
  workgroupBarrier();
  if (lane != 0u) { return; }
  let within = atomicLoad(&first_within);
  var pixels = 0.0;
  if (within >= DETAIL_BUCKETS) {
    pixels = bucket_start(f32(DETAIL_BUCKETS));
  } else if (within > 0u) {
    let over = f32(looked_at[within - 1u] - view.splat_budget);
    pixels = bucket_start(f32(within) + over / f32(looked_at[within - 1u] - looked_at[within]));
  }
  chunk_shares[arrayLength(&chunk_shares) - 1u] = pixels;
}
