// Statistics of `cull` over all blocks, cleared before every frame: number of unusable splats; bits of the minimum
// (inverted, so that 0 means none) and of the maximum depth of the visible ones; and their total coverage of the image,
// in COVERED_UNITs.
const UNUSABLE = 0u;
const NEAREST_INVERTED = 1u;
const FARTHEST = 2u;
const COVERED = 3u;
// Coverage is counted in 4096ths of the image within a group of 256 splats, and in 64ths over all groups: 2^26 splats
// may cover the whole image before the sum overflows.
const SHARE_UNIT = 4096u;
const COVERED_UNIT = 64u;
const CULL_STATS_WORDS = 4u;
