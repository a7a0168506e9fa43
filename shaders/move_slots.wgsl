// Translates the splats of slots that hold another instance of the same file. Each workgroup moves its splats of every
// slot.
#import shared/packed_gaussian
#import shared/group
#import shared/slot_move

@group(0) @binding(0) var<storage, read> moves: array<SlotMove>;
@group(0) @binding(1) var<storage, read_write> gaussians: array<PackedGaussian>;

const SLOT_SPLATS = SLOT_CHUNKS * CULL_GROUP;
const MOVE_THREADS = 256u;

@compute @workgroup_size(MOVE_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let one = moves[workgroup_id.x];
  let first = one.slot * SLOT_SPLATS;
  for (var k = lane; k < SLOT_SPLATS; k += MOVE_THREADS) {
    let head = gaussians[first + k].head;
    gaussians[first + k].head = vec4u(bitcast<vec3u>(bitcast<vec3f>(head.xyz) + one.by), head.w);
  }
}
