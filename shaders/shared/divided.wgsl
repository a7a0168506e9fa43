// Long lists of small tiles, divided into segments. They lie in the buffer `bin_order` behind the bins, the number
// of long bins and the pairs of the longest: the numbers of segments and of divided lists; for each tile the number of its segments, 0 if its list is
// not divided, or EMPTY_LIST; for each divided list its tile, first segment, number of segments, and the cost of a segment;
// for each segment its tile, its number among those of the tile with their number, its first word of bits, the one after
// its last, and the cost in front of it. The cost of a list is the number of its splats and of the words of bits that are
// searched for them: to search 256 words takes as long as to rasterize 256 splats.
#import shared/bins

// Capacity in segments.
const MAX_SEGMENTS = 1024u;
// Maximum number of segments of equal size; each divided list may have one more, of other size. Images of more tiles
// have fewer, because their tiles keep more of a GPU busy: the number times that of bins is at most SHARED_BINS.
const SHARED_SEGMENTS = 640u;
const SHARED_BINS = 23040u;
// Maximum number of segments of equal size of one list: one workgroup sums them.
const LIST_SEGMENTS = 64u;
// Maximum number of tiles.
const MAX_TILES = 128u * TILES_PER_BIN;
// In place of a number of segments: a tile that no splat touches.
const EMPTY_LIST = 0xffffffffu;
const SEGMENT_NUMBERS = 6u;
const END_AT = MAX_SEGMENTS * SEGMENT_NUMBERS * 256u;
const DIVIDED_WORDS = 4u;
const MAX_DIVIDED = SHARED_SEGMENTS / 2u;
const SEGMENT_WORDS = 5u;
const DIVIDED_AT = 3u + MAX_TILES;
const DIVISION_WORDS = DIVIDED_AT + MAX_DIVIDED * DIVIDED_WORDS + MAX_SEGMENTS * SEGMENT_WORDS;

// The corner of a tile in pixels.
fn corner_of(view: BinView, bin: u32, tile_in_bin: u32) -> vec2u {
  let tile = vec2u(bin % view.bins.x, bin / view.bins.x) * vec2u(BIN_COLUMNS, BIN_ROWS)
    + vec2u(tile_in_bin % BIN_COLUMNS, tile_in_bin / BIN_COLUMNS);
  return tile * view.tile_side;
}

// Whether a tile has pixels: bins at the edges have tiles outside the image.
fn is_seen(view: BinView, corner: vec2u) -> bool { return all(vec2f(corner) < view.viewport); }

fn segment_count_at(view: BinView) -> u32 { return view.bins.x * view.bins.y + 2u; }
fn tile_segments_at(view: BinView, tile: u32) -> u32 { return segment_count_at(view) + 2u + tile; }
fn divided_at(view: BinView, list: u32) -> u32 { return tile_segments_at(view, MAX_TILES) + DIVIDED_WORDS * list; }
fn segment_at(view: BinView, segment: u32) -> u32 { return divided_at(view, MAX_DIVIDED) + SEGMENT_WORDS * segment; }
