// Rasterizes whole lists, one tile or square for each workgroup.
#import shared/paint_tiles

@compute @workgroup_size(TILE_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let number = group_index(workgroup_id) * view.parts + view.part;
  let bins = view.bins.x * view.bins.y;
  // The small tiles of long bins come first, one by one, then those of the other bins, four at a time.
  var single_bins = bins;
  if (view.tile_side < SIDE) { single_bins = bin_order[bins]; }
  var nth = number / TILES_PER_BIN;
  var tile_in_bin = number % TILES_PER_BIN;
  let step = u32(nth >= single_bins);
  block_side = view.tile_side / (BLOCK_COLUMNS >> step);
  if (step == 1u) {
    let square = tile_in_bin % SQUARES_PER_BIN;
    nth += 3u * (nth - single_bins) + tile_in_bin / SQUARES_PER_BIN;
    // Two rows of squares are two rows of tiles each.
    tile_in_bin = 2u * (square + (square & SQUARES_PER_ROW));
  }
  if (nth >= bins) { return; }
  let bin = bin_order[nth];
  let tile = vec2u(bin % view.bins.x, bin / view.bins.x) * vec2u(BIN_COLUMNS, BIN_ROWS)
    + vec2u(tile_in_bin % BIN_COLUMNS, tile_in_bin / BIN_COLUMNS);
  let corner = tile * view.tile_side;
  // Bins at the edges have tiles outside the image.
  if (any(vec2f(corner) >= view.viewport)) { return; }
  let threads = block_side * block_side / COLUMN;
  let own_block = lane / threads;
  let in_block = lane % threads;
  // The topmost pixel of the thread, relative to the corner.
  var own_pixel = vec2u(own_block % BLOCK_COLUMNS, own_block / BLOCK_COLUMNS) * block_side
    + vec2u(in_block % block_side, in_block / block_side * COLUMN);
  if (own_block >= BLOCKS) { own_pixel.x = NOWHERE; }
  let position = corner + own_pixel;
  let place = vec2f(own_pixel) + 0.5;
  let min_power = log2(ALPHA_MIN);

  var pixels = start_pixels(position);
  if (lane == 0u) { paints[NO_SPLAT].y = bitcast<u32>(NO_POWER); }
  var list = begin_list(bin, tile_in_bin, step);
  // The splats of the next batch are fetched before this one is rasterized, so that memory and arithmetic overlap.
  var slot = 0u;
  var found_ahead = find_batch(&list, BATCH, lane, &slot);
  var splat_ahead = splats[slot];
  loop {
    if (lane < BLOCKS * BATCH_WORDS) { atomicStore(&block_hits[lane], 0u); }
    if (lane == 0u) { atomicStore(&unfinished, 0u); }
    aux_clear(lane);
    workgroupBarrier();
    let count = found_ahead;
    if (count == 0u) { break; }
    if (lane < count) { load_splat(lane, slot, splat_ahead, vec2f(corner)); }
    workgroupBarrier();
    found_ahead = find_batch(&list, BATCH, lane, &slot);
    splat_ahead = splats[slot];

    paint_batch(&pixels, own_block, place, min_power);
    if (found_ahead > 0u) { carry_pixels(&pixels, place); }
    if (!are_finished(pixels)) { atomicStore(&unfinished, 1u); }
    workgroupBarrier();

    if (lane < count) { aux_store(lane); }
    if (lane == 0u) { is_open = atomicLoad(&unfinished); }
    if (workgroupUniformLoad(&is_open) == 0u) { break; }
  }
  finish_pixels(&pixels, position);
}
