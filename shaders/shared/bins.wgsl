// Screen tiles on two scales. A bin is a block of 8 x 4 tiles: splats are listed for each bin, in depth order, and a
// 32-bit mask has one bit for each tile of the bin that a splat touches. A tile has SMALL_TILE pixels a side where a
// frame has few bins, or where pixels sort their own splats, which takes more registers; otherwise TILE. Four small
// tiles are rasterized together, except those of the bins with the longest lists.
const TILE = 32u;
const SMALL_TILE = 16u;
// Side of a tile where a small image has very long lists.
const TINY_TILE = 8u;
const BIN_COLUMNS = 8u;
const BIN_ROWS = 4u;
const TILES_PER_BIN = BIN_COLUMNS * BIN_ROWS;
// Squares of four small tiles that are rasterized together.
const SQUARES_PER_ROW = BIN_COLUMNS / 2u;
const SQUARES_PER_BIN = 2u * SQUARES_PER_ROW;
// A bin is long if it has more than 1 / LONG_BINS of all pairs, so fewer than LONG_BINS bins are long.
const LONG_BINS = 64u;

// Words of 32 bits with one bit for each of the 256 pairs that are contiguous in `tile_bits`.
const PAIR_WORDS = 8u;

// Index in `tile_bits` of the bits of a tile (its number within the bin) for pairs 32·word ... 32·word + 31: eight
// words of one tile are contiguous, a sector of memory, then those of the next tile.
fn tile_word(word: u32, tile_in_bin: u32) -> u32 {
  return (word / PAIR_WORDS) * (PAIR_WORDS * TILES_PER_BIN) + tile_in_bin * PAIR_WORDS + word % PAIR_WORDS;
}

struct BinView {
  // Pixels.
  viewport: vec2f,
  // Bins across and down.
  bins: vec2u,
  // Premultiplied red, green, blue and alpha behind the splats.
  background: vec4f,
  // Capacity of the buffers in pairs of splat and bin. Pairs beyond it, the farthest, are dropped.
  pair_capacity: u32,
  // Capacity in groups of 256 splats.
  splat_groups: u32,
  // A slow frame is rasterized in several submissions: this one draws tile number `part` of every `parts` tiles.
  part: u32,
  parts: u32,
  // A pixel is finished before a splat that would reduce its transmittance to this value or below.
  transmittance_min: f32,
  // Side of a tile of the lists in pixels: TILE or SMALL_TILE.
  tile_side: u32,
}

// Width and height of a bin in pixels.
fn bin_size(view: BinView) -> vec2f {
  return f32(view.tile_side) * vec2f(f32(BIN_COLUMNS), f32(BIN_ROWS));
}
