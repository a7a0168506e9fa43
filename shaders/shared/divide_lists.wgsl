// In place of shared/undivided: decides which lists are divided, and into how many segments.
#import shared/divided
#import shared/prefix

// For each tile of each bin the number of splats that touch it; zero for the next frame once it has been read.
@group(0) @binding(3) var<storage, read_write> tile_splats: array<u32>;
// See shared/segments.
@group(0) @binding(4) var<storage, read> segments: array<f32>;

// Minimum cost of a segment.
override segment_splats: u32 = 512u;

var<workgroup> costs: atomic<u32>;
var<workgroup> segment_count: atomic<u32>;
var<workgroup> divided_count: atomic<u32>;

// The cost of the splats of a tile that are expected to be rasterized, and of all. A tile that was finished in the last
// frame will be after about as many.
fn cost_of(tile: u32) -> vec2u {
  if (tile_splats[tile] == 0u || !is_seen(view, corner_of(view, tile / TILES_PER_BIN, tile % TILES_PER_BIN))) { return vec2u(0u); }
  let range = ranges[tile / TILES_PER_BIN];
  let cost = tile_splats[tile] + (range.y + 31u) / 32u - range.x / 32u;
  let end = u32(segments[END_AT + tile]);
  return vec2u(select(cost, min(cost, end + end / 4u + 256u), end > 0u), cost);
}

// A list is divided if it has at least twice the cost of a segment. Splats behind the expected end have a segment of
// their own.
fn divide_lists(lane: u32) {
  let tiles = view.bins.x * view.bins.y * TILES_PER_BIN;
  var sum = 0u;
  for (var tile = lane; tile < tiles; tile += PREFIX_THREADS) { sum += cost_of(tile).x; }
  atomicAdd(&costs, sum);
  workgroupBarrier();
  let shared_segments = min(SHARED_SEGMENTS, SHARED_BINS / (view.bins.x * view.bins.y));
  let min_cost = max(segment_splats, atomicLoad(&costs) / shared_segments + 1u);
  for (var tile = lane; tile < tiles; tile += PREFIX_THREADS) {
    let own = cost_of(tile);
    var count = min(own.x / min_cost, LIST_SEGMENTS);
    let size = own.x / max(count, 1u);
    if (count < 2u) { count = 0u; } else if (own.x < own.y) { count++; }
    bin_order[tile_segments_at(view, tile)] = select(count, EMPTY_LIST, tile_splats[tile] == 0u);
    tile_splats[tile] = 0u;
    if (count == 0u) { continue; }
    let at = divided_at(view, atomicAdd(&divided_count, 1u));
    bin_order[at] = tile;
    bin_order[at + 1u] = atomicAdd(&segment_count, count);
    bin_order[at + 2u] = count;
    bin_order[at + 3u] = size;
  }
  workgroupBarrier();
  if (lane != 0u) { return; }
  bin_order[segment_count_at(view)] = atomicLoad(&segment_count);
  bin_order[segment_count_at(view) + 1u] = atomicLoad(&divided_count);
}
