// In place of shared/undivided: counts the splats of each tile, for bin_cut.
#import shared/bins
#import shared/bits

// For each tile of each bin the number of splats that touch it.
@group(0) @binding(7) var<storage, read_write> tile_splats: array<atomic<u32>>;
// For each 256 pairs the number of those that touch each tile of their bin.
@group(0) @binding(8) var<storage, read_write> group_splats: array<u32>;

var<workgroup> bit_counts: array<u32, 32u * PAIR_WORDS>;

// @param word Bits of a tile for 32 pairs: see bin_index. @param mask Tiles of the pair of this thread.
fn count_splats(first: u32, end: u32, lane: u32, word: u32, mask: u32) {
  bit_counts[lane] = countOneBits(word);
  workgroupBarrier();
  var sum = 0u;
  if (lane < TILES_PER_BIN) {
    for (var k = 0u; k < PAIR_WORDS; k++) { sum += bit_counts[lane * PAIR_WORDS + k]; }
    group_splats[first / PAIR_WORDS + lane] = sum;
  }
  if (bins[first] == bins[end - 1u]) {
    if (sum > 0u) { atomicAdd(&tile_splats[bins[first] * TILES_PER_BIN + lane], sum); }
    return;
  }
  // Few groups have pairs of several bins.
  var ahead = mask;
  while (ahead > 0u) {
    atomicAdd(&tile_splats[bins[first + lane] * TILES_PER_BIN + zeros_below(ahead)], 1u);
    ahead &= ahead - 1u;
  }
}
