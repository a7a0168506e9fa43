// By how much what lies in a slot of a pool is moved.
struct SlotMove {
  by: vec3f,
  slot: u32,
}

// Chunks that a slot has room for.
const SLOT_CHUNKS = 4u;
