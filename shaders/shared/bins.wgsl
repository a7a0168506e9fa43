// Two scales of screen tiles. A bin is a block of 8 x 4 tiles of 16 x 16 pixels: splats are listed for each bin, in depth
// order, and a mask of 32 bits says which of the bin's tiles each of them touches.
#import shared/occlusion

const BIN_COLUMNS = 8u;
const BIN_ROWS = 4u;
const TILES_PER_BIN = BIN_COLUMNS * BIN_ROWS;
const BIN_WIDTH = BIN_COLUMNS * TILE;
const BIN_HEIGHT = BIN_ROWS * TILE;

struct BinView {
  // Pixels.
  viewport: vec2f,
  // Bins across and down.
  bins: vec2u,
  // Premultiplied red, green, blue and alpha behind the splats.
  background: vec4f,
  // Pairs of splat and bin that the buffers have room for. Pairs beyond it, the farthest, are left out.
  pair_capacity: u32,
}
