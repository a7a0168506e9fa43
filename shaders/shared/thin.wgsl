// Thinning an order of all splats to the visible ones, which keeps it: each workgroup takes a block of it, each thread a run.
#import shared/thin_order
#import shared/prefix

// Splats of a thread's run.
const THIN_RUN = THIN_BLOCK / PREFIX_THREADS;

// First of the run of a thread, in words of four.
fn run_start(workgroup_id: vec3u, lane: u32) -> u32 {
  return (group_index(workgroup_id) * THIN_BLOCK + lane * THIN_RUN) / 4u;
}
