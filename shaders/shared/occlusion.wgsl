// How far one sees: for each tile of 16 x 16 pixels a camera depth, as the bits of a float32, beyond which nothing shows, and
// behind those the same for blocks of 4 x 4 tiles. OPEN where no depth is known.
const TILE = 16u;
const OCCLUSION_BLOCK = 4u;
const OPEN = 0x7f800000u;

// Blocks across and down of so many tiles.
fn occlusion_blocks(tiles: vec2u) -> vec2u {
  return (tiles + OCCLUSION_BLOCK - 1u) / OCCLUSION_BLOCK;
}
