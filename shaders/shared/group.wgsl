// Workgroup counts beyond 65,535 are dispatched in two dimensions.
const MAX_GROUPS_X = 65535u;

fn group_index(workgroup_id: vec3u) -> u32 {
  return workgroup_id.x + workgroup_id.y * MAX_GROUPS_X;
}

// Splats of a chunk, which is culled as a whole or by one workgroup of `cull` and `compact`, and the 32-bit words with
// one bit for each.
const CULL_GROUP = 256u;
const WORDS_PER_GROUP = CULL_GROUP / 32u;
// Splats of one workgroup of `project`.
const PROJECT_GROUP = 256u;
