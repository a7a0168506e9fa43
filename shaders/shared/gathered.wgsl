// What `cull` gathers over all pages, cleared before every frame: splats refused because a value was not usable, and the bits
// of the least (inverted, so that 0 means none) and the greatest depth of the visible ones.
const UNUSABLE = 0u;
const NEAREST_INVERTED = 1u;
const FARTHEST = 2u;
const GATHERED_WORDS = 4u;
