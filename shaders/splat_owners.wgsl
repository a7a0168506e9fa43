// Lists the owner of each survivor of a block by slot: the id of its scene, or of its group of splats. Runs between
// `compact` and the sort, which overwrites the list of survivors.
#import shared/view
#import shared/plan
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> survivors: array<u32>;
@group(0) @binding(2) var<storage, read> plan: Plan;
// Id of the scene, followed by what is added for each splat of the block; nothing is added beyond the end.
@group(0) @binding(3) var<storage, read> ids: array<u32>;
// By slot.
@group(0) @binding(4) var<storage, read_write> owners: array<u32>;

@compute @workgroup_size(PROJECT_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let page = plan.pages[view.page];
  let rank = group_index(workgroup_id) * PROJECT_GROUP + lane;
  if (rank >= page.survivors) { return; }
  let slot = page.first_slot + rank;
  let splat = survivors[slot] - view.first_group * CULL_GROUP;
  var owner = ids[0];
  if (splat + 1u < arrayLength(&ids)) { owner += ids[splat + 1u]; }
  owners[slot] = owner;
}
