// Rasterizes tiles, one workgroup each, front to back in float32 registers, and stops when nothing behind is visible.
// The importing module defines:
// - the pixels of a thread (shared/column or shared/single);
// - `Pixels`, a thread's pixels, with `start_pixels`, `paint_batch`, `are_finished` and `finish_pixels`;
// - additional data for each splat: `packed_color`, `load_more`, `aux_clear` and `aux_store`.
#import shared/bits
#import shared/group
#import shared/tile_list
#import shared/tile_image

// Bins in rasterization order, followed by the number of long bins.
@group(0) @binding(6) var<storage, read> bin_order: array<u32>;

// True to reject the splat that would reduce the transmittance below the threshold, as trainers do at REFUSED; false to
// blend it and end the pixel behind it. At a higher threshold a rejected splat would be a hole, since an opaque one
// leaves only 1/1,000.
override refuses_last: bool = true;

// Splats in each batch.
const BATCH = TILE_THREADS;
const BATCH_WORDS = BATCH / 32u;
// A tile has 4 x 4 blocks of pixels; neighboring threads draw one block, and skip splats that do not touch it together.
const BLOCK_COLUMNS = 4u;
const BLOCK_ROWS = 4u;
const BLOCKS = BLOCK_COLUMNS * BLOCK_ROWS;
// Coordinate of the pixel of a thread without one: outside of any image.
const NOWHERE = 0x1000000u;
// Minimum transmittance of a pixel in training.
const REFUSED = 1e-4;
// Index of the placeholder for a missing splat, and log2 of its opacity.
const NO_SPLAT = BATCH;
const NO_POWER = -1e30;
// sqrt(log2(e) / 2): in axes stretched by it a Gaussian is 2^-(u² + v²).
const BASE_2_AXIS = 0.8493218002880191;

// The splats of a batch, front to back, relative to the tile, followed by a placeholder that reaches no pixel. At x, y
// from the tile's corner alpha is 2^(power - u² - v²) with u = u_x · x + u_0 and v = v_x · x + v_y · y + v_0. Vectors,
// because some compilers read a struct word by word: u_x, u_0, v_x, v_y;
var<workgroup> axes: array<vec4f, BATCH + 1u>;
// v_0 and power as float32 bits, and the words of `packed_color`.
var<workgroup> paints: array<vec4u, BATCH + 1u>;
// For each block of the tile one bit for each splat of the batch that touches it.
var<workgroup> block_hits: array<atomic<u32>, BLOCKS * BATCH_WORDS>;
var<workgroup> unfinished: atomic<u32>;
var<workgroup> is_open: u32;
// Side of a block in pixels.
var<private> block_side: u32;

// Sets the bits of splat k of the batch in the blocks of the tile that it touches.
fn hit_blocks(k: u32, s: ProjectedSplat, tile_corner: vec2f) {
  let c = coverage_of(s);
  let word = k / 32u;
  let bit = 1u << (k % 32u);
  let size = f32(block_side);
  // Row k holds the pixel centers k·height + 0.5 ... (k + 1)·height - 0.5. The loop covers only the rows that the splat
  // touches, because neighboring threads touch other rows.
  let low = c.center.y - c.extent.y - tile_corner.y - RIM;
  let high = c.center.y + c.extent.y - tile_corner.y + RIM;
  let first_row = clamp(ceil((low + 0.5) / size) - 1.0, 0.0, f32(BLOCK_ROWS));
  let end_row = clamp(floor((high - 0.5) / size) + 1.0, 0.0, f32(BLOCK_ROWS));
  for (var row = u32(first_row); row < u32(end_row); row++) {
    let top = tile_corner.y + f32(row) * size + 0.5;
    let range = band_range(c, top - RIM, top + size - 1.0 + RIM) + vec2f(-RIM, RIM) - tile_corner.x;
    if (range.x > range.y) { continue; }
    // Columns likewise.
    let first = max(ceil((range.x + 0.5) / size) - 1.0, 0.0);
    let last = min(floor((range.y - 0.5) / size), f32(BLOCK_COLUMNS) - 1.0);
    if (first > last) { continue; }
    let end = u32(last) + 1u;
    for (var column = u32(first); column < end; column++) {
      atomicOr(&block_hits[(row * BLOCK_COLUMNS + column) * BATCH_WORDS + word], bit);
    }
  }
}

fn load_splat(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) {
  load_more(k, slot, s, tile_corner);
  hit_blocks(k, s, tile_corner);
  let center = s.shape.xy - tile_corner;
  let u_x = s.shape.z * BASE_2_AXIS;
  let v_y = bitcast<f32>(s.paint.x) * BASE_2_AXIS;
  let v_x = -s.shape.w * v_y;
  let v_0 = -v_x * center.x - v_y * center.y;
  let power = log2(bitcast<f32>(s.paint.w));
  axes[k] = vec4f(u_x, -u_x * center.x, v_x, v_y);
  paints[k] = vec4u(bitcast<u32>(v_0), bitcast<u32>(power), packed_color(s, slot));
}
