// Paints tiles of 16 x 16 pixels, one workgroup each and one thread a pixel, front to back in float32 registers, and stops
// when nothing behind can be seen. Whoever imports this says how a pixel takes the splats of a batch: `packed_color`, `load_more`, `paint_batch` and
// `paint_rest` (shared/paint_listed); what is noted on the way: `clear_notes`, `keep_notes` and `note_pixel`; and what else is in the picture: `start_pixel`.
#import shared/bins
#import shared/bits
#import shared/coverage
#import shared/prefix

@group(0) @binding(0) var<uniform> view: BinView;
@group(0) @binding(1) var<storage, read> splats: array<ProjectedSplat>;
// Slots: bin by bin, in depth order.
@group(0) @binding(2) var<storage, read> pairs: array<u32>;
@group(0) @binding(3) var<storage, read> ranges: array<vec2u>;
// Which pairs touch which tile: see tile_word.
@group(0) @binding(4) var<storage, read> tile_bits: array<u32>;
@group(0) @binding(5) var image: texture_storage_2d<rgba16float, write>;

// True if the splat that would leave a pixel too little light is refused, as trainers do at REFUSED; false if it is blended and the pixel ends behind it: at
// a higher threshold a refused splat is a hole, since an opaque one leaves 1/1,000 by itself.
override refuses_last: bool = true;
// True to write premultiplied colour over the background, false for colour and transmittance.
override is_final: bool = false;
// True if the image holds float16, and if it holds bytes. Neither: float32.
override writes_half: bool = true;
override writes_bytes: bool = false;

const TILE_THREADS = TILE * TILE;
const BATCH_WORDS = TILE_THREADS / 32u;
// A tile's blocks of pixels; neighbouring threads paint one, and skip what does not touch it together.
const BLOCK_WIDTH = 4u;
const BLOCK_HEIGHT = 4u;
const BLOCK_COLUMNS = TILE / BLOCK_WIDTH;
const BLOCK_ROWS = TILE / BLOCK_HEIGHT;
const BLOCK_THREADS = BLOCK_WIDTH * BLOCK_HEIGHT;
const BLOCKS = BLOCK_COLUMNS * BLOCK_ROWS;
// Light that trainers leave a pixel at least.
const REFUSED = 1e-4;
// Where the splat lies that takes the place of a missing one, and log2 of its opacity.
const NO_SPLAT = TILE_THREADS;
const NO_POWER = -1e30;
// sqrt(log2(e) / 2): in axes stretched by it a Gaussian is 2^-(u² + v²).
const BASE_2_AXIS = 0.8493218002880191;

// A splat as the pixels of one tile see it: at x, y from the tile's corner its alpha is 2^(power - u² - v²) with u = u_x · x + u_0 and
// v = v_x · x + v_y · y + v_0. Without differences from its centre a pixel has two operations less for each splat.
struct Brush {
  u_x: f32,
  u_0: f32,
  v_x: f32,
  v_y: f32,
  v_0: f32,
  // log2 of the opacity
  power: f32,
  // As `packed_color` says.
  color: vec2u,
}

// The window on the bin's pairs: a bit for each that touches the tile, and how many of these there are up to the end of each word.
var<workgroup> window: array<u32, TILE_THREADS>;
var<workgroup> found_upto: array<u32, TILE_THREADS>;
var<workgroup> found: u32;
// How the splats at hand paint, a batch, front to back, and behind the last place of the batch one that reaches no pixel;
var<workgroup> brushes: array<Brush, TILE_THREADS + 1u>;
// for each block of the tile a bit for each splat that touches it.
var<workgroup> block_hits: array<atomic<u32>, BLOCKS * BATCH_WORDS>;
var<workgroup> unfinished: atomic<u32>;
var<workgroup> is_open: u32;

fn pixel_in_tile(lane: u32) -> vec2u {
  let number = lane / BLOCK_THREADS;
  let row = number / BLOCK_COLUMNS;
  let column = number - row * BLOCK_COLUMNS;
  let in_block = lane - number * BLOCK_THREADS;
  let x = column * BLOCK_WIDTH + in_block % BLOCK_WIDTH;
  let y = row * BLOCK_HEIGHT + in_block / BLOCK_WIDTH;
  return vec2u(x, y);
}

// Notes splat k of the batch for the blocks of the tile that it touches.
fn hit_blocks(k: u32, s: ProjectedSplat, tile_corner: vec2f) {
  let c = coverage_of(s);
  let word = k / 32u;
  let bit = 1u << (k % 32u);
  let size = vec2f(f32(BLOCK_WIDTH), f32(BLOCK_HEIGHT));
  // Row k holds the pixel centres k·height + 0.5 ... (k + 1)·height - 0.5. Only the rows at hand: threads side by side have others.
  let low = c.center.y - c.extent.y - tile_corner.y - RIM;
  let high = c.center.y + c.extent.y - tile_corner.y + RIM;
  let first_row = clamp(ceil((low + 0.5) / size.y) - 1.0, 0.0, f32(BLOCK_ROWS));
  let end_row = clamp(floor((high - 0.5) / size.y) + 1.0, 0.0, f32(BLOCK_ROWS));
  for (var row = u32(first_row); row < u32(end_row); row++) {
    let top = tile_corner.y + f32(row) * size.y + 0.5;
    let range = band_range(c, top - RIM, top + size.y - 1.0 + RIM) + vec2f(-RIM, RIM) - tile_corner.x;
    if (range.x > range.y) { continue; }
    // Columns likewise.
    let first = max(ceil((range.x + 0.5) / size.x) - 1.0, 0.0);
    let last = min(floor((range.y - 0.5) / size.x), f32(BLOCK_COLUMNS) - 1.0);
    if (first > last) { continue; }
    let end = u32(last) + 1u;
    for (var column = u32(first); column < end; column++) {
      atomicOr(&block_hits[(row * BLOCK_COLUMNS + column) * BATCH_WORDS + word], bit);
    }
  }
}

// Moves the window to the words from `first` on. Ends with a barrier.
fn move_window(first: u32, range: vec2u, tile_in_bin: u32, lane: u32) {
  let word = first + lane;
  var hits = 0u;
  if (32u * word < range.y) {
    hits = tile_bits[tile_word(word, tile_in_bin)];
    // The first and the last word may hold pairs of other bins.
    if (32u * word < range.x) { hits &= 0xffffffffu << (range.x - 32u * word); }
    if (32u * word + 32u > range.y) { hits &= 0xffffffffu >> (32u * word + 32u - range.y); }
  }
  let upto = inclusive_sum(countOneBits(hits), lane, TILE_THREADS);
  window[lane] = hits;
  found_upto[lane] = upto;
  if (lane == TILE_THREADS - 1u) { found = upto; }
  workgroupBarrier();
}

// The nth pair that the window found, counted from its first word.
fn found_pair(nth: u32) -> u32 {
  var word = 0u;
  for (var step = TILE_THREADS / 2u; step > 0u; step /= 2u) {
    if (found_upto[word + step - 1u] <= nth) { word += step; }
  }
  var bits = window[word];
  var ahead = nth + countOneBits(bits) - found_upto[word];
  var bit = 0u;
  for (var width = 16u; width > 0u; width /= 2u) {
    let below = countOneBits(bits & ((1u << width) - 1u));
    if (ahead >= below) {
      ahead -= below;
      bits >>= width;
      bit += width;
    }
  }
  return 32u * word + bit;
}

fn load_splat(k: u32, slot: u32, tile_corner: vec2f) {
  let s = splats[slot];
  load_more(k, slot, s, tile_corner);
  hit_blocks(k, s, tile_corner);
  let center = s.shape.xy - tile_corner;
  let u_x = s.shape.z * BASE_2_AXIS;
  let v_y = bitcast<f32>(s.paint.x) * BASE_2_AXIS;
  let v_x = -s.shape.w * v_y;
  let power = log2(bitcast<f32>(s.paint.w));
  brushes[k] = Brush(u_x, -u_x * center.x, v_x, v_y, -v_x * center.x - v_y * center.y, power, packed_color(s, slot));
}

struct Pixel {
  color: vec3f,
  transmittance: f32,
  // Transmittance to which no splat may take the pixel, or behind which none is blended; once that has come, or there is nothing to paint, FINISHED.
  least: f32,
}

// No splat leaves more.
const FINISHED = 2.0;

fn is_finished(pixel: Pixel) -> bool {
  return pixel.least >= FINISHED;
}

// Storing may cut off what the image has no room for, which costs 5 dB. So what is stored is the nearest of the numbers that float16 can hold, in its
// normal range,
fn nearest_half(v: vec4f) -> vec4f {
  let bits = bitcast<vec4u>(v);
  let is_odd = (bits >> vec4u(13u)) & vec4u(1u);
  return bitcast<vec4f>((bits + vec4u(0xfffu) + is_odd) & vec4u(0xffffe000u));
}

// or the nearest byte, and so little more that it is that byte rounded as well as cut off.
fn nearest_byte(v: vec4f) -> vec4f {
  return (floor(v * 255.0 + 0.5) + 0.25) / 255.0;
}

@compute @workgroup_size(TILE_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let tile = view.first_tile + workgroup_id.xy;
  let corner = tile * TILE;
  let position = corner + pixel_in_tile(lane);
  let place = vec2f(pixel_in_tile(lane)) + 0.5;
  let is_outside = any(vec2f(position) + 0.5 > view.viewport);
  let own_block = lane / BLOCK_THREADS;
  let bin = tile / vec2u(BIN_COLUMNS, BIN_ROWS);
  let in_bin = tile % vec2u(BIN_COLUMNS, BIN_ROWS);
  let tile_in_bin = in_bin.y * BIN_COLUMNS + in_bin.x;
  let range = ranges[bin.y * view.bins.x + bin.x];

  var pixel = Pixel(vec3f(0.0), 1.0, select(view.transmittance_min, FINISHED, is_outside));
  if (!is_outside) { start_pixel(position); }
  let least_power = log2(ALPHA_MIN);
  if (lane == 0u) { brushes[NO_SPLAT].power = NO_POWER; }
  // First word of the window and the one behind it, and how many of the pairs found in it have been painted.
  var first_word = range.x / 32u;
  var next_word = first_word;
  var in_window = 0u;
  var painted = 0u;
  loop {
    for (var i = lane; i < BLOCKS * BATCH_WORDS; i += TILE_THREADS) { atomicStore(&block_hits[i], 0u); }
    if (lane == 0u) { atomicStore(&unfinished, 0u); }
    clear_notes(lane);
    workgroupBarrier();
    // Fills a batch, from as many windows as that takes.
    var count = 0u;
    while (count < TILE_THREADS) {
      if (painted == in_window) {
        if (32u * next_word >= range.y) { break; }
        first_word = next_word;
        next_word += TILE_THREADS;
        move_window(first_word, range, tile_in_bin, lane);
        in_window = workgroupUniformLoad(&found);
        painted = 0u;
      }
      let taken = min(in_window - painted, TILE_THREADS - count);
      if (lane < taken) {
        let pair = 32u * first_word + found_pair(painted + lane);
        load_splat(count + lane, pairs[pair], vec2f(corner));
      }
      painted += taken;
      count += taken;
    }
    if (count == 0u) { break; }
    workgroupBarrier();

    paint_batch(&pixel, own_block, place, least_power);
    if (!is_finished(pixel)) { atomicStore(&unfinished, 1u); }
    workgroupBarrier();

    if (lane < count) { keep_notes(lane); }
    if (lane == 0u) { is_open = atomicLoad(&unfinished); }
    if (workgroupUniformLoad(&is_open) == 0u) { break; }
  }
  if (is_outside) { return; }
  paint_rest(&pixel);
  note_pixel(position);
  var result = vec4f(pixel.color, pixel.transmittance);
  if (is_final) { result = vec4f(pixel.color, 1.0 - pixel.transmittance) + pixel.transmittance * view.background; }
  if (writes_half) { result = nearest_half(result); }
  if (writes_bytes) { result = nearest_byte(result); }
  textureStore(image, position, result);
}
