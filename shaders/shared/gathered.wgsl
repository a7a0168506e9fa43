// What `cull` gathers over all pages, cleared before every frame: splats refused because a value was not usable, the bits
// of the least (inverted, so that 0 means none) and the greatest depth of the visible ones, and how often these cover the
// image: the sum of their shares of its pixels, in COVERED_UNITs.
const UNUSABLE = 0u;
const NEAREST_INVERTED = 1u;
const FARTHEST = 2u;
const COVERED = 3u;
// Shares of the image are counted in 4096ths within a group of 256 splats, and in 64ths over all groups: 2^26 splats may
// cover the whole image before the sum overflows.
const SHARE_UNIT = 4096u;
const COVERED_UNIT = 64u;
const GATHERED_WORDS = 4u;
