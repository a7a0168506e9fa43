// Translation of the contents of one slot of a pool.
struct SlotMove {
  by: vec3f,
  slot: u32,
}

// Capacity of a slot in chunks.
const SLOT_CHUNKS = 4u;
