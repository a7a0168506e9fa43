// Long lists of small tiles, divided into segments. They lie in the buffer `bin_order` behind the bins and the number
// of long bins: the numbers of segments and of divided lists; for each tile the number of its segments, 0 if its list is
// not divided; for each divided list its tile, first segment, number of segments, and splats of a segment; for each
// segment its tile, its number among those of the tile with their number, its first word of bits, the one after its last,
// and the number of splats in front of it.
#import shared/bins

// Capacity in segments.
const MAX_SEGMENTS = 1024u;
// Segments of equal size share this number; each divided list may have one more, of other size.
const SHARED_SEGMENTS = 640u;
// Maximum number of tiles.
const MAX_TILES = 128u * TILES_PER_BIN;
const SEGMENT_NUMBERS = 6u;
const END_AT = MAX_SEGMENTS * SEGMENT_NUMBERS * 256u;
const DIVIDED_WORDS = 4u;
const MAX_DIVIDED = SHARED_SEGMENTS / 2u;
const SEGMENT_WORDS = 5u;
const DIVIDED_AT = 3u + MAX_TILES;
const DIVISION_WORDS = DIVIDED_AT + MAX_DIVIDED * DIVIDED_WORDS + MAX_SEGMENTS * SEGMENT_WORDS;

fn segment_count_at(view: BinView) -> u32 { return view.bins.x * view.bins.y + 1u; }
fn tile_segments_at(view: BinView, tile: u32) -> u32 { return segment_count_at(view) + 2u + tile; }
fn divided_at(view: BinView, list: u32) -> u32 { return tile_segments_at(view, MAX_TILES) + DIVIDED_WORDS * list; }
fn segment_at(view: BinView, segment: u32) -> u32 { return divided_at(view, MAX_DIVIDED) + SEGMENT_WORDS * segment; }
