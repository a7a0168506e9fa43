// In place of shared/whole_lists, for images of few tiles: long lists are divided into segments (bin_cut), which
// workgroups rasterize at the same time, in three dispatches, so that no frame waits for a few tiles:
// 0. the first segment of each divided list, the light that each other segment but the last lets through, and all lists
//    that are not divided;
// 1. the other segments: the light before a segment is the product of those in front of it, so that pixels end where
//    they would in the whole list;
// 2. the sums of the segments.
#import shared/paint_tiles
#import shared/divided

// UNDIVIDED: no list is divided.
override stage: u32 = 0u;
const UNDIVIDED = 3u;

// For each segment and thread: light behind it, red, green, blue, the transmittance that it takes, and the depth that
// halves it. Followed by the cost of each tile until it was finished in the last frame.
@group(0) @binding(14) var<storage, read_write> segments: array<f32>;

// The words from `begin` to `end` of the list of a tile.
fn begin_segment(bin: u32, tile: u32, begin: u32, end: u32) -> ListPlace {
  let all = ranges[bin];
  let range = vec2u(max(all.x, 32u * begin), min(all.y, 32u * end));
  return ListPlace(range, tile, 0u, begin, begin, 0u, 0u);
}

// The pixel of a thread, relative to the corner.
fn pixel_of(lane: u32) -> vec2u {
  let own_block = lane / (block_side * block_side);
  let in_block = lane % (block_side * block_side);
  // A tiny tile has fewer pixels than threads.
  if (own_block >= BLOCKS) { return vec2u(NOWHERE); }
  let corner = vec2u(own_block % BLOCK_COLUMNS, own_block / BLOCK_COLUMNS) * block_side;
  return corner + vec2u(in_block % block_side, in_block / block_side);
}

// As `blend` of shared/paint_columns, for light alone.
fn dim(pixels: ptr<function, Pixels>, k: u32, place: vec2f, min_power: f32) {
  let axis = axes[k];
  let paint = paints[k].xy;
  let u = axis.x * place.x + axis.y;
  let v = axis.w * place.y + (axis.z * place.x + bitcast<f32>(paint.x));
  let power = (bitcast<f32>(paint.y) - u * u) - v * v;
  let alpha = select(0.0, min(ALPHA_MAX, exp2(power)), power >= min_power);
  hide(pixels, k);
  (*pixels).light -= (*pixels).light * alpha;
}

fn dim_batch(pixels: ptr<function, Pixels>, own_block: u32, place: vec2f, min_power: f32) {
  for (var word = 0u; word < BATCH_WORDS; word++) {
    if (are_finished(*pixels)) { break; }
    var ahead = atomicLoad(&block_hits[own_block * BATCH_WORDS + word]);
    while (ahead > 0u) {
      let k = word * 32u + zeros_below(ahead);
      ahead &= ahead - 1u;
      let next = select(NO_SPLAT, word * 32u + zeros_below(ahead), ahead != 0u);
      ahead &= ahead - 1u;
      dim(pixels, k, place, min_power);
      dim(pixels, next, place, min_power);
    }
  }
}

// Rasterizes the splats of a list until all pixels are finished. If `only_light`, only their light is changed. Returns
// the cost of what was searched and rasterized: see shared/divided.
fn paint_list(pixels: ptr<function, Pixels>, first: ListPlace, corner: vec2u, lane: u32, only_light: bool) -> u32 {
  let own_block = lane / (block_side * block_side);
  let place = vec2f(pixel_of(lane)) + 0.5;
  let min_power = log2(ALPHA_MIN);
  var list = first;
  var painted = 0u;
  if (lane == 0u) { paints[NO_SPLAT].y = bitcast<u32>(NO_POWER); }
  // If lists are long, the next batch is fetched before this one is rasterized, as in shared/whole_lists.
  let is_ahead = stage != UNDIVIDED;
  var slot = 0u;
  var found_ahead = 0u;
  var splat_ahead = ProjectedSplat();
  if (is_ahead) {
    found_ahead = find_batch(&list, BATCH, lane, &slot);
    splat_ahead = splats[slot];
  }
  loop {
    if (lane < BLOCKS * BATCH_WORDS) { atomicStore(&block_hits[lane], 0u); }
    if (lane == 0u) { atomicStore(&unfinished, 0u); }
    aux_clear(lane);
    workgroupBarrier();
    var count = found_ahead;
    if (!is_ahead) { count = load_batch(&list, BATCH, vec2f(corner), lane); }
    if (count == 0u) { break; }
    if (is_ahead && lane < count) { load_splat(lane, slot, splat_ahead, vec2f(corner)); }
    workgroupBarrier();
    if (is_ahead) {
      found_ahead = find_batch(&list, BATCH, lane, &slot);
      splat_ahead = splats[slot];
    }

    if (only_light) { dim_batch(pixels, own_block, place, min_power); }
    else { paint_batch(pixels, own_block, place, min_power); }
    if (!are_finished(*pixels)) { atomicStore(&unfinished, 1u); }
    workgroupBarrier();

    if (lane < count) { aux_store(lane); }
    painted += count;
    if (lane == 0u) { is_open = atomicLoad(&unfinished); }
    if (workgroupUniformLoad(&is_open) == 0u) { break; }
  }
  return painted + min(list.next_word, (first.range.y + 31u) / 32u) - first.first_word;
}

fn number_at(segment: u32, number: u32, lane: u32) -> u32 {
  return (segment * SEGMENT_NUMBERS + number) * TILE_THREADS + lane;
}

fn are_all_finished(pixels: Pixels, lane: u32) -> bool {
  if (lane == 0u) { atomicStore(&unfinished, 0u); }
  workgroupBarrier();
  if (!are_finished(pixels)) { atomicStore(&unfinished, 1u); }
  workgroupBarrier();
  if (lane == 0u) { is_open = atomicLoad(&unfinished); }
  return workgroupUniformLoad(&is_open) == 0u;
}

// Keeps the cost of a tile until it is finished; zero, if it has no splats.
fn keep_end(tile: u32, cost: u32, lane: u32) {
  if (lane == 0u) { segments[END_AT + tile] = f32(cost); }
}

fn sum_segments(first: u32, count: u32, position: vec2u, lane: u32) {
  var sum = Pixels(Column(0.0), Column(0.0), Column(0.0), Column(0.0), Column(1.0));
  var depth = 0.0;
  for (var k = first; k < first + count; k++) {
    sum.red += segments[number_at(k, 1u, lane)];
    sum.green += segments[number_at(k, 2u, lane)];
    sum.blue += segments[number_at(k, 3u, lane)];
    sum.transmittance -= segments[number_at(k, 4u, lane)];
    depth = max(depth, segments[number_at(k, 5u, lane)]);
  }
  keep_depth(depth);
  finish_pixels(&sum, position);
}

// Rasterizes segment `nth` of the `count` segments of a tile.
fn paint_segment(segment: u32, tile: u32, nth: u32, count: u32, lane: u32) {
  let at = segment_at(view, segment);
  let bin = tile / TILES_PER_BIN;
  let tile_in_bin = tile % TILES_PER_BIN;
  let corner = corner_of(view, bin, tile_in_bin);
  let position = corner + pixel_of(lane);
  if (stage == 2u) {
    if (nth == 0u) { sum_segments(segment, count, position, lane); }
    return;
  }
  let only_light = stage == 0u && nth > 0u;
  let is_last = nth + 1u == count;
  // The first dispatch rasterizes the first segment; nothing is behind the last.
  if (select(nth == 0u, only_light && is_last, stage == 0u)) { return; }
  var pixels = start_pixels(position);
  if (stage == 1u) {
    for (var k = segment - nth; k < segment; k++) { pixels.light *= segments[number_at(k, 0u, lane)]; }
    pixels.transmittance = pixels.light;
  }
  let before = pixels.light;
  let is_behind = stage == 1u && are_all_finished(pixels, lane);
  if (!is_behind) {
    let list = begin_segment(bin, tile_in_bin, bin_order[at + 2u], bin_order[at + 3u]);
    let painted = paint_list(&pixels, list, corner, lane, only_light);
    if (!only_light && (is_last || are_all_finished(pixels, lane))) {
      keep_end(tile, bin_order[at + 4u] + painted, lane);
    }
  }
  if (stage == 0u) { segments[number_at(segment, 0u, lane)] = pixels.light; }
  if (only_light) { return; }
  segments[number_at(segment, 1u, lane)] = pixels.red;
  segments[number_at(segment, 2u, lane)] = pixels.green;
  segments[number_at(segment, 3u, lane)] = pixels.blue;
  segments[number_at(segment, 4u, lane)] = before - pixels.transmittance;
  segments[number_at(segment, 5u, lane)] = kept_depth();
}

@compute @workgroup_size(TILE_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let group = group_index(workgroup_id);
  block_side = view.tile_side / BLOCK_COLUMNS;
  if (stage == UNDIVIDED || (stage == 0u && group >= MAX_SEGMENTS)) {
    let number = select(group - MAX_SEGMENTS, group * view.parts + view.part, stage == UNDIVIDED);
    if (number >= view.bins.x * view.bins.y * TILES_PER_BIN) { return; }
    let bin = bin_order[number / TILES_PER_BIN];
    let tile_in_bin = number % TILES_PER_BIN;
    let tile = bin * TILES_PER_BIN + tile_in_bin;
    let corner = corner_of(view, bin, tile_in_bin);
    if (!is_seen(view, corner)) { return; }
    var list = begin_list(bin, tile_in_bin, 0u);
    if (stage == 0u) {
      let count = bin_order[tile_segments_at(view, tile)];
      if (count == EMPTY_LIST) { list = ListPlace(); } else if (count > 0u) { return; }
    }
    let position = corner + pixel_of(lane);
    var pixels = start_pixels(position);
    let painted = paint_list(&pixels, list, corner, lane, false);
    finish_pixels(&pixels, position);
    if (stage == 0u) { keep_end(tile, painted, lane); }
    return;
  }
  if (group >= bin_order[segment_count_at(view)]) { return; }
  let at = segment_at(view, group);
  let numbers = bin_order[at + 1u];
  paint_segment(group, bin_order[at], numbers & 0xffffu, numbers >> 16u, lane);
}
