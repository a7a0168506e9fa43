// Bins for the stages that list splats, which are compiled for a tile size.
#import shared/bins

// Side of a tile in pixels: TILE or SORTED_TILE.
override tile_side: u32 = TILE;

fn bin_size() -> vec2f {
  return f32(tile_side) * vec2f(f32(BIN_COLUMNS), f32(BIN_ROWS));
}
