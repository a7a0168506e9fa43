// Two scales of screen tiles. A bin is a block of 8 x 4 tiles: splats are listed for each bin, in depth order, and a mask of 32 bits says which of the bin's
// tiles each of them touches.
// Side of a tile in pixels; and where each pixel sorts splats by itself, which takes more registers.
const TILE = 32u;
const SORTED_TILE = 16u;
const BIN_COLUMNS = 8u;
const BIN_ROWS = 4u;
const TILES_PER_BIN = BIN_COLUMNS * BIN_ROWS;

// Words of 32 bits with a bit for each of the 256 pairs that lie together in `tile_bits`.
const PAIR_WORDS = 8u;

// Where the bits of a tile (its number within the bin) for pairs 32·word ... 32·word + 31 lie in `tile_bits`: eight words of one tile side by
// side, a sector of memory, then those of the next.
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
  // Pairs of splat and bin that the buffers have room for. Pairs beyond it, the farthest, are left out.
  pair_capacity: u32,
  // Groups of 256 splats that there is room for.
  splat_groups: u32,
  // A frame with much to do is painted in several parts: of every `parts` tiles, the one with the number `part`.
  part: u32,
  parts: u32,
  // A pixel is finished before a splat that would take its transmittance to this or below.
  transmittance_min: f32,
}
