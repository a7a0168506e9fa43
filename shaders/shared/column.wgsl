// The pixels of a thread: four, one above the other. A workgroup rasterizes SIDE · SIDE = 256 · COLUMN pixels at most: a
// tile, or a square of four small tiles. Only 64 threads have pixels of a single small tile.
const SIDE: u32 = TILE;
const COLUMN: u32 = 4u;
alias Column = vec4f;
alias Flags = vec4<bool>;
const STEPS = Column(0.0, 1.0, 2.0, 3.0);

fn finish_pixels(pixels: ptr<function, Pixels>, position: vec2u) {
  hide_rest(pixels);
  for (var row = 0u; row < COLUMN; row++) {
    let pixel = position + vec2u(0u, row);
    if (any(vec2f(pixel) >= view.viewport)) { break; }
    aux_pixel(pixel, row);
    store_pixel(pixel, vec3f((*pixels).red[row], (*pixels).green[row], (*pixels).blue[row]), (*pixels).transmittance[row]);
  }
}
