// WebGL 2 shaders cannot read buffers, so arrays lie in textures of this width, row by row.
const DATA_WIDTH = 4096u;

fn texel_of(i: u32) -> vec2u {
  return vec2u(i % DATA_WIDTH, i / DATA_WIDTH);
}
