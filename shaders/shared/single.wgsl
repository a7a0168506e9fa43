// In place of shared/column: a thread has one pixel, so that all threads have pixels of a small tile.
const SIDE: u32 = SMALL_TILE;
const COLUMN: u32 = 1u;
alias Column = f32;
alias Flags = bool;
const STEPS = 0.0;

fn finish_pixels(pixels: ptr<function, Pixels>, position: vec2u) {
  hide_rest(pixels);
  if (any(vec2f(position) >= view.viewport)) { return; }
  aux_pixel(position, 0u);
  store_pixel(position, vec3f((*pixels).red, (*pixels).green, (*pixels).blue), (*pixels).transmittance);
}
