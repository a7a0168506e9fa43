// Counts of one frame, written on the GPU and never read back on the frame path. Dispatches are as large as the
// capacity, and groups beyond these counts end at once, because an indirect dispatch costs browsers up to a millisecond
// (decision 18).
struct Plan {
  // Splats to draw: the survivors of culling, at most the capacity of the renderer's buffers.
  visible: u32,
  // Survivors beyond the capacity.
  overflow: u32,
  // Blocks of SORT_BLOCK keys.
  sort_blocks: u32,
  // In depth order the survivors of all blocks are mixed, so each block processes all of them.
  pages: array<PagePlan>,
}

struct PagePlan {
  // Slot of the first survivor.
  first_slot: u32,
  survivors: u32,
}

// Keys of one workgroup of the sort.
const SORT_BLOCK = 1024u;
// Quads drawn as one instance, because instances of four vertices leave most lanes of a GPU idle.
const QUAD_BATCH = 128u;
