// Thinning an order of all splats to the visible ones, which keeps it: each workgroup takes a block of it, each thread a run.
#import shared/prefix
#import shared/group

struct Thin {
  // Splats in the order, a multiple of four.
  length: u32,
}

const THIN_RUN = 8u;
const THIN_BLOCK = THIN_RUN * PREFIX_THREADS;

@group(0) @binding(0) var<uniform> thin: Thin;
// Numbers of splats, four to a word.
@group(0) @binding(1) var<storage, read> order: array<vec4u>;
@group(0) @binding(2) var<storage, read> visible_bits: array<u32>;

fn visible_flags(numbers: vec4u) -> vec4u {
  let words = vec4u(
    visible_bits[numbers.x / 32u], visible_bits[numbers.y / 32u], visible_bits[numbers.z / 32u], visible_bits[numbers.w / 32u],
  );
  return (words >> (numbers % vec4u(32u))) & vec4u(1u);
}

// First of the run of a thread, in words of four.
fn run_start(workgroup_id: vec3u, lane: u32) -> u32 {
  return (group_index(workgroup_id) * THIN_BLOCK + lane * THIN_RUN) / 4u;
}
