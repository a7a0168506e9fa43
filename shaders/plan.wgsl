// Prefix sums of the survivors of each group, or of each block of the sort, and the counts for the stages that follow.
#import shared/scan
#import shared/plan_counts

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(local_invocation_index) lane: u32) {
  scan_values(limits.length, lane);
  if (lane == 0u) { write_plan(); }
}
