// Lets the workgroup of a tile find the pairs of its bin that touch the tile. The importing module has 256 threads and
// defines `load_splat`.
#import shared/bins
#import shared/coverage
#import shared/prefix

@group(0) @binding(0) var<uniform> view: BinView;
@group(0) @binding(1) var<storage, read> splats: array<ProjectedSplat>;
// Slots: bin by bin, in depth order.
@group(0) @binding(2) var<storage, read> pairs: array<u32>;
@group(0) @binding(3) var<storage, read> ranges: array<vec2u>;
// Bits of the pairs that touch each tile: see tile_word.
@group(0) @binding(4) var<storage, read> tile_bits: array<u32>;

const TILE_THREADS = PREFIX_THREADS;

// A window over the pairs of the bin: one bit for each pair that touches the tile, and their running count at the end
// of each word.
var<workgroup> window: array<u32, TILE_THREADS>;
var<workgroup> found_upto: array<u32, TILE_THREADS>;
var<workgroup> found: u32;

// Position of a tile in the list of its bin. The same for all threads.
struct ListPlace {
  // First and end of the bin's pairs.
  range: vec2u,
  // Number of the tile within the bin, or of the first of a square of four; 0 for one tile, 1 for a square.
  tile: u32,
  step: u32,
  // First word of the window and the one after it; pairs found in the window, and the number of them already loaded.
  first_word: u32,
  next_word: u32,
  in_window: u32,
  loaded: u32,
}

fn begin_list(bin: u32, tile: u32, step: u32) -> ListPlace {
  let range = ranges[bin];
  let first_word = range.x / 32u;
  return ListPlace(range, tile, step, first_word, first_word, 0u, 0u);
}

fn bits_of(word: u32, tile: u32) -> u32 { return tile_bits[tile_word(word, tile)]; }

// Moves the window to the words from `first_word` on. Ends with a barrier.
fn move_window(place: ListPlace, lane: u32) {
  let range = place.range;
  let word = place.first_word + lane;
  var hits = 0u;
  if (32u * word < range.y) {
    let below = place.tile + place.step * BIN_COLUMNS;
    hits = bits_of(word, place.tile) | bits_of(word, place.tile + place.step)
      | bits_of(word, below) | bits_of(word, below + place.step);
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

// Finds the next `limit` splats of the tile, or fewer at the end of the list, in as many windows as necessary. Each
// thread receives the slot of one of them, in order. Returns their number.
fn find_batch(place: ptr<function, ListPlace>, limit: u32, lane: u32, slot: ptr<function, u32>) -> u32 {
  var count = 0u;
  while (count < limit) {
    if ((*place).loaded == (*place).in_window) {
      if (32u * (*place).next_word >= (*place).range.y) { break; }
      (*place).first_word = (*place).next_word;
      (*place).next_word += TILE_THREADS;
      move_window(*place, lane);
      (*place).in_window = workgroupUniformLoad(&found);
      (*place).loaded = 0u;
    }
    let taken = min((*place).in_window - (*place).loaded, limit - count);
    if (lane >= count && lane < count + taken) {
      *slot = pairs[32u * (*place).first_word + found_pair((*place).loaded + lane - count)];
    }
    (*place).loaded += taken;
    count += taken;
  }
  return count;
}

// Finds a batch and loads it. A barrier must follow.
fn load_batch(place: ptr<function, ListPlace>, limit: u32, tile_corner: vec2f, lane: u32) -> u32 {
  var slot = 0u;
  let count = find_batch(place, limit, lane, &slot);
  if (lane < count) { load_splat(lane, slot, splats[slot], tile_corner); }
  return count;
}
