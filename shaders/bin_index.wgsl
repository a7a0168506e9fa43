// Finds the range of each bin in the pairs sorted by bin. Also sets, for each tile of a bin, one bit for each pair that
// touches it, so that a tile skips all other pairs.
#import shared/bins
#import shared/coverage
#import shared/plan
#import shared/group
#import shared/undivided

@group(0) @binding(0) var<storage, read> pair_plan: Plan;
// Bins of the sorted pairs.
@group(0) @binding(1) var<storage, read> bins: array<u32>;
@group(0) @binding(2) var<storage, read> pairs: array<u32>;
// First pair of each bin and the one after its last; both are equal if a bin is empty.
@group(0) @binding(3) var<storage, read_write> ranges: array<vec2u>;
// See tile_word.
@group(0) @binding(4) var<storage, read_write> tile_bits: array<u32>;
@group(0) @binding(5) var<uniform> view: BinView;
@group(0) @binding(6) var<storage, read> splats: array<ProjectedSplat>;

// Rows of 32 masks, padded by one word so that threads that read a column access different memory banks.
const MASK_ROW = 33u;
var<workgroup> masks: array<u32, MASK_ROW * PAIR_WORDS>;

// Mask of the tiles of a bin that a splat touches: one bit each, in rows of eight.
fn touched_tiles(c: Coverage, bin: vec2u) -> u32 {
  let corner = vec2f(bin) * bin_size(view);
  let tile = f32(view.tile_side);
  // Row k holds the pixel centers k·tile + 0.5 ... (k + 1)·tile - 0.5. The loop covers only the rows that the splat
  // touches, because neighboring threads touch other rows.
  let low = c.center.y - c.extent.y - corner.y - RIM;
  let high = c.center.y + c.extent.y - corner.y + RIM;
  let first_row = clamp(ceil((low - (tile - 0.5)) / tile), 0.0, f32(BIN_ROWS));
  let end_row = clamp(floor((high - 0.5) / tile) + 1.0, 0.0, f32(BIN_ROWS));
  var mask = 0u;
  for (var row = u32(first_row); row < u32(end_row); row++) {
    let top = corner.y + f32(row) * tile + 0.5;
    let range = band_range(c, top - RIM, top + tile - 1.0 + RIM) + vec2f(-RIM, RIM);
    if (range.x > range.y) { continue; }
    // Columns likewise.
    let first = max(ceil((range.x - corner.x - (tile - 0.5)) / tile), 0.0);
    let last = min(floor((range.y - corner.x - 0.5) / tile), f32(BIN_COLUMNS) - 1.0);
    if (first > last) { continue; }
    let upto = (2u << u32(last)) - 1u;
    let below = (1u << u32(first)) - 1u;
    mask |= (upto & ~below) << (row * BIN_COLUMNS);
  }
  return mask;
}

@compute @workgroup_size(PROJECT_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let first = group_index(workgroup_id) * PROJECT_GROUP;
  if (first >= pair_plan.visible) { return; }
  let i = first + lane;
  var mask = 0u;
  if (i < pair_plan.visible) {
    let bin = bins[i];
    mask = touched_tiles(coverage_of(splats[pairs[i]]), vec2u(bin % view.bins.x, bin / view.bins.x));
    if (i == 0u || bins[i - 1u] != bin) { ranges[bin].x = i; }
    if (i == pair_plan.visible - 1u || bins[i + 1u] != bin) { ranges[bin].y = i + 1u; }
  }
  masks[MASK_ROW * (lane / 32u) + lane % 32u] = mask;
  workgroupBarrier();
  // Thread `lane` writes word `lane` of the group: the bits of this tile for these 32 pairs.
  let tile = lane / PAIR_WORDS;
  let row = MASK_ROW * (lane % PAIR_WORDS);
  var word = 0u;
  for (var k = 0u; k < 32u; k++) { word |= ((masks[row + k] >> tile) & 1u) << k; }
  tile_bits[first + lane] = word;
  count_splats(first, min(first + PROJECT_GROUP, pair_plan.visible), lane, word, mask);
}
