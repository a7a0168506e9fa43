// Paints tiles of 16 x 16 pixels, one workgroup each and one thread a pixel, front to back in float32 registers, and stops
// when nothing behind can be seen. Whoever imports this says what is noted on the way: `clear_notes`, `note_blend`,
// `keep_notes` and `note_pixel`.
#import shared/bins
#import shared/coverage

@group(0) @binding(0) var<uniform> view: BinView;
@group(0) @binding(1) var<storage, read> splats: array<ProjectedSplat>;
// Slot, and the tiles of the bin that the splat touches: bin by bin, in depth order.
@group(0) @binding(2) var<storage, read> pairs: array<vec2u>;
@group(0) @binding(3) var<storage, read> ranges: array<vec2u>;
// How far one could see in each tile when the splats were culled, and how far one did see.
@group(0) @binding(4) var<storage, read> occlusion: array<u32>;
@group(0) @binding(5) var<storage, read_write> last_depths: array<u32>;
@group(0) @binding(6) var image: texture_storage_2d<rgba16float, write>;

// A pixel is finished before a splat that would take its transmittance to this or below.
override transmittance_min: f32 = 1e-4;
// A pixel with this transmittance or less hides what lies behind from the next frame.
override occluded_below: f32 = 0.01;
// True to write premultiplied colour over the background, false for colour and transmittance.
override is_final: bool = false;

const TILE_THREADS = TILE * TILE;
// Pairs that a thread looks at in one go, and words with a bit for each pair of all threads.
const PAIRS_PER_THREAD = 2u;
const HIT_WORDS = PAIRS_PER_THREAD * TILE_THREADS / 32u;
const BATCH_WORDS = TILE_THREADS / 32u;
// Blocks of 8 x 4 pixels, each painted by 32 threads.
const BLOCKS = TILE_THREADS / 32u;
// Splats that wait to be painted: those just found and, at most a batch, those left over from before.
const QUEUE = (PAIRS_PER_THREAD + 1u) * TILE_THREADS;
// sqrt(log2(e) / 2): in axes stretched by it a Gaussian is 2^-(u² + v²).
const BASE_2_AXIS = 0.8493218002880191;

// A bit for each pair just looked at that touches the tile.
var<workgroup> hits: array<atomic<u32>, HIT_WORDS>;
// Slots of the splats to paint, front to back.
var<workgroup> queue: array<u32, QUEUE>;
var<workgroup> queued: u32;
// The splats at hand, a batch of the queue: centre, 1 / sigma_x in those axes, slope;
var<workgroup> shapes: array<vec4f, TILE_THREADS>;
// 1 / sigma_v in those axes, red and green, blue and depth, log2 of the opacity;
var<workgroup> paints: array<vec4u, TILE_THREADS>;
// for each block of 8 x 4 pixels of the tile a bit for each splat that touches it.
var<workgroup> block_hits: array<atomic<u32>, BLOCKS * BATCH_WORDS>;
var<workgroup> unfinished: atomic<u32>;
var<workgroup> is_open: u32;
// Bits of the depth of the splat that left the last pixel of the tile hardly transparent, and 1 if there are pixels that still are.
var<workgroup> seen_depth: atomic<u32>;
var<workgroup> is_transparent: atomic<u32>;

// 32 neighbouring threads paint a block of 8 x 4 pixels, so that they skip a splat together.
fn pixel_in_tile(lane: u32) -> vec2u {
  let own = lane / 32u;
  return vec2u((own % 2u) * 8u + lane % 8u, (own / 2u) * 4u + (lane / 8u) % 4u);
}

// Notes splat k of the batch for the blocks of the tile that it touches.
fn hit_blocks(k: u32, s: ProjectedSplat, tile_corner: vec2f) {
  let c = coverage_of(s);
  let word = k / 32u;
  let bit = 1u << (k % 32u);
  for (var row = 0u; row < 4u; row++) {
    let top = tile_corner.y + f32(row) * 4.0 + 0.5;
    let range = band_range(c, top - 0.01, top + 3.01) + vec2f(-0.01, 0.01) - tile_corner.x;
    if (range.x > range.y) { continue; }
    if (range.x <= 7.5 && range.y >= 0.5) { atomicOr(&block_hits[2u * row * BATCH_WORDS + word], bit); }
    if (range.x <= 15.5 && range.y >= 8.5) { atomicOr(&block_hits[(2u * row + 1u) * BATCH_WORDS + word], bit); }
  }
}

// Adds the pairs from `start` on that touch the tile to the queue, in their order. Ends with a barrier.
fn find_splats(start: u32, end: u32, tile_bit: u32, lane: u32) {
  if (lane < HIT_WORDS) { atomicStore(&hits[lane], 0u); }
  workgroupBarrier();
  var slots: array<u32, PAIRS_PER_THREAD>;
  var is_hit: array<bool, PAIRS_PER_THREAD>;
  for (var j = 0u; j < PAIRS_PER_THREAD; j++) {
    let i = start + j * TILE_THREADS + lane;
    is_hit[j] = false;
    if (i < end) {
      let pair = pairs[i];
      slots[j] = pair.x;
      is_hit[j] = (pair.y & tile_bit) != 0u;
      if (is_hit[j]) { atomicOr(&hits[(j * TILE_THREADS + lane) / 32u], 1u << (lane % 32u)); }
    }
  }
  workgroupBarrier();
  let own_word = lane / 32u;
  var place = queued;
  for (var w = 0u; w < HIT_WORDS; w++) {
    let word = atomicLoad(&hits[w]);
    let j = w / (TILE_THREADS / 32u);
    if (w % (TILE_THREADS / 32u) == own_word && is_hit[j]) {
      queue[place + countOneBits(word & ((1u << (lane % 32u)) - 1u))] = slots[j];
    }
    place += countOneBits(word);
  }
  workgroupBarrier();
  if (lane == 0u) { queued = place; }
}

fn load_splat(k: u32, tile_corner: vec2f) {
  let s = splats[queue[k]];
  hit_blocks(k, s, tile_corner);
  shapes[k] = s.shape * vec4f(1.0, 1.0, BASE_2_AXIS, 1.0);
  let inverse_sigma_v = bitcast<f32>(s.paint.x) * BASE_2_AXIS;
  let power = log2(bitcast<f32>(s.paint.w));
  paints[k] = vec4u(bitcast<u32>(inverse_sigma_v), s.paint.yz, bitcast<u32>(power));
}

// Least float16 with all its digits: depths below it, or above the greatest, are not known well enough.
const HALF_MIN = 6.104e-5;

// Notes how far one sees through a pixel, and the first thread how far one saw in the tile. One that is transparent, or became opaque
// only beyond the depth up to which its splats are complete, is opened. Has barriers.
fn note_depth(tile: u32, lane: u32, is_seen_through: bool, last_seen: u32) {
  atomicMax(&seen_depth, bitcast<u32>(unpack2x16float(last_seen).y));
  if (is_seen_through) { atomicStore(&is_transparent, 1u); }
  workgroupBarrier();
  if (lane != 0u) { return; }
  let depth = bitcast<f32>(atomicLoad(&seen_depth));
  let is_known = depth > HALF_MIN && depth < HALF_MAX && depth <= bitcast<f32>(occlusion[tile]);
  last_depths[tile] = select(OPEN, bitcast<u32>(depth), is_known && atomicLoad(&is_transparent) == 0u);
}

@compute @workgroup_size(TILE_THREADS)
fn main(@builtin(workgroup_id) tile: vec3u, @builtin(num_workgroups) tiles: vec3u, @builtin(local_invocation_index) lane: u32) {
  let corner = tile.xy * TILE;
  let pixel = corner + pixel_in_tile(lane);
  let center = vec2f(pixel) + 0.5;
  let own_block = lane / 32u;
  let bin = tile.xy / vec2u(BIN_COLUMNS, BIN_ROWS);
  let in_bin = tile.xy % vec2u(BIN_COLUMNS, BIN_ROWS);
  let tile_bit = 1u << (in_bin.y * BIN_COLUMNS + in_bin.x);
  let range = ranges[bin.y * view.bins.x + bin.x];
  let power_min = log2(alpha_min);

  var color = vec3f(0.0);
  var transmittance = 1.0;
  var finished = any(center > view.viewport);
  // Blue and depth of the last splat that was blended while the pixel was transparent.
  var last_seen = 0u;
  var start = range.x;
  loop {
    var waiting = workgroupUniformLoad(&queued);
    while (waiting < TILE_THREADS && start < range.y) {
      find_splats(start, range.y, tile_bit, lane);
      start += PAIRS_PER_THREAD * TILE_THREADS;
      waiting = workgroupUniformLoad(&queued);
    }
    let count = min(waiting, TILE_THREADS);
    if (count == 0u) { break; }
    if (lane < BLOCKS * BATCH_WORDS) { atomicStore(&block_hits[lane], 0u); }
    if (lane == 0u) { atomicStore(&unfinished, 0u); }
    workgroupBarrier();
    if (lane < count) { load_splat(lane, vec2f(corner)); }
    clear_notes(lane);
    workgroupBarrier();

    var word = 0u;
    var ahead = atomicLoad(&block_hits[own_block * BATCH_WORDS]);
    while (!finished) {
      // The next splat of the batch that touches the block.
      if (ahead == 0u) {
        word++;
        if (word == BATCH_WORDS) { break; }
        ahead = atomicLoad(&block_hits[own_block * BATCH_WORDS + word]);
        continue;
      }
      let k = word * 32u + countTrailingZeros(ahead);
      ahead &= ahead - 1u;
      let shape = shapes[k];
      let paint = paints[k];
      let offset = center - shape.xy;
      let u = offset.x * shape.z;
      let v = (offset.y - shape.w * offset.x) * bitcast<f32>(paint.x);
      let power = bitcast<f32>(paint.w) - u * u - v * v;
      if (power < power_min) { continue; }
      let alpha = min(ALPHA_MAX, exp2(power));
      // The last one to be blended while the pixel is transparent is the one that ends it.
      if (transmittance > occluded_below) { last_seen = paint.z; }
      let remaining = transmittance * (1.0 - alpha);
      if (remaining <= transmittance_min) {
        finished = true;
        continue;
      }
      let weight = transmittance * alpha;
      note_blend(k, weight, transmittance, remaining, paint.z);
      color += weight * vec3f(unpack2x16float(paint.y), unpack2x16float(paint.z).x);
      transmittance = remaining;
    }
    if (!finished) { atomicStore(&unfinished, 1u); }
    workgroupBarrier();

    if (lane < count) { keep_notes(lane, queue[lane]); }

    // What is left over moves up: read by all before it is overwritten.
    let left = waiting - count;
    var moved: array<u32, PAIRS_PER_THREAD>;
    for (var j = 0u; j < PAIRS_PER_THREAD; j++) {
      moved[j] = 0u;
      if (j * TILE_THREADS + lane < left) { moved[j] = queue[count + j * TILE_THREADS + lane]; }
    }
    if (lane == 0u) {
      is_open = atomicLoad(&unfinished);
      queued = left;
    }
    if (workgroupUniformLoad(&is_open) == 0u) { break; }
    for (var j = 0u; j < PAIRS_PER_THREAD; j++) {
      if (j * TILE_THREADS + lane < left) { queue[j * TILE_THREADS + lane] = moved[j]; }
    }
  }
  let is_outside = any(center > view.viewport);
  let is_seen_through = !is_outside && !finished && transmittance > occluded_below;
  note_depth(tile.y * tiles.x + tile.x, lane, is_seen_through, last_seen);
  if (is_outside) { return; }
  note_pixel(pixel);
  var result = vec4f(color, transmittance);
  if (is_final) { result = vec4f(color, 1.0 - transmittance) + transmittance * view.background; }
  textureStore(image, pixel, result);
}
