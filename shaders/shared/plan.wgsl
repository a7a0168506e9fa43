// Counts and indirect arguments of one frame, written on the GPU and never read back on the frame path.
struct Plan {
  // Splats to draw: those that survive culling, at most the capacity of the renderer's buffers.
  visible: u32,
  // Survivors that found no room.
  overflow: u32,
  // Blocks of SORT_BLOCK keys.
  sort_blocks: u32,
  // Arguments of dispatchWorkgroupsIndirect for one workgroup a sort block.
  sort_x: u32,
  sort_y: u32,
  sort_z: u32,
  // Arguments of dispatchWorkgroupsIndirect for one thread a visible splat, 256 to a workgroup.
  visible_x: u32,
  visible_y: u32,
  visible_z: u32,
  // Arguments of drawIndexedIndirect for the quads.
  quad_indices: u32,
  quad_instances: u32,
  quad_first_index: u32,
  quad_base_vertex: u32,
  quad_first_instance: u32,
  // For each page: slot of its first survivor, survivors, and dispatch arguments of `project`.
  // In depth order the survivors of all pages are mixed, and each page is given all of them.
  pages: array<PagePlan>,
}

struct PagePlan {
  first_slot: u32,
  survivors: u32,
  project_x: u32,
  project_y: u32,
  project_z: u32,
}

// Keys of one workgroup of the sort.
const SORT_BLOCK = 2048u;
// Quads drawn as one instance: instances of four vertices leave most lanes of a GPU idle.
const QUAD_BATCH = 128u;
