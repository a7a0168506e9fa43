// An order of all splats that is thinned to the visible ones, in blocks.
#import shared/group

struct Thin {
  // Splats in the order, a multiple of four.
  length: u32,
}

// Splats of a block.
const THIN_BLOCK = 2048u;
// Blocks of a workgroup where each thread takes a whole one.
const BLOCKS_PER_SERIAL_GROUP = 4u;

@group(0) @binding(0) var<uniform> thin: Thin;
// Numbers of splats, four to a word.
@group(0) @binding(1) var<storage, read> order: array<vec4u>;
@group(0) @binding(2) var<storage, read> visible_bits: array<u32>;

// Number of the block that a thread takes as a whole, and where it begins and ends, in words of four. Behind the order it is empty.
fn serial_block(workgroup_id: vec3u, lane: u32) -> vec3u {
  let block_id = group_index(workgroup_id) * BLOCKS_PER_SERIAL_GROUP + lane;
  let end = thin.length / 4u;
  let words = THIN_BLOCK / 4u;
  return vec3u(block_id, min(block_id * words, end), min((block_id + 1u) * words, end));
}

fn visible_flags(numbers: vec4u) -> vec4u {
  let words = vec4u(
    visible_bits[numbers.x / 32u], visible_bits[numbers.y / 32u], visible_bits[numbers.z / 32u], visible_bits[numbers.w / 32u],
  );
  return (words >> (numbers % vec4u(32u))) & vec4u(1u);
}
