// `move_slots` for the geometry of shared/quantized_gaussian: only the origins of the chunks move. One thread for each
// chunk.
#import shared/quantized_layout
#import shared/slot_move

@group(0) @binding(0) var<storage, read> moves: array<SlotMove>;
@group(0) @binding(1) var<storage, read_write> gaussians: array<vec4u>;

@compute @workgroup_size(SLOT_CHUNKS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let one = moves[workgroup_id.x];
  let row = (one.slot * SLOT_CHUNKS + lane) * QUANTIZED_CHUNK_ROWS;
  let head = gaussians[row];
  gaussians[row] = vec4u(bitcast<vec3u>(bitcast<vec3f>(head.xyz) + one.by), head.w);
}
