// Divides the list of a tile into segments of the same cost, to the nearest 256 pairs of the bin. The last segment
// has the rest. One workgroup for each divided list.
#import shared/divided
#import shared/prefix

@group(0) @binding(0) var<uniform> view: BinView;
@group(0) @binding(1) var<storage, read> ranges: array<vec2u>;
@group(0) @binding(2) var<storage, read_write> bin_order: array<u32>;
// For each 256 pairs the number of those that touch each tile of their bin.
@group(0) @binding(3) var<storage, read> group_splats: array<u32>;

const GROUP_PAIRS = 32u * PAIR_WORDS;
var<workgroup> divided: vec4u;

// @param words The first word of the bin and the one after its last.
fn cost_of(group: u32, tile: u32, words: vec2u) -> u32 {
  let own = min((group + 1u) * PAIR_WORDS, words.y) - max(group * PAIR_WORDS, words.x);
  return group_splats[group * TILES_PER_BIN + tile % TILES_PER_BIN] + own;
}

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let list = workgroup_id.x;
  if (lane == 0u && list < bin_order[segment_count_at(view) + 1u]) {
    let at = divided_at(view, list);
    divided = vec4u(bin_order[at], bin_order[at + 1u], bin_order[at + 2u], bin_order[at + 3u]);
  }
  let own_list = workgroupUniformLoad(&divided);
  let tile = own_list.x;
  let first_segment = own_list.y;
  let count = own_list.z;
  let size = own_list.w;
  if (count == 0u) { return; }
  let range = ranges[tile / TILES_PER_BIN];
  let first_group = range.x / GROUP_PAIRS;
  let end_group = (range.y + GROUP_PAIRS - 1u) / GROUP_PAIRS;
  let words = vec2u(range.x / 32u, (range.y + 31u) / 32u);
  let groups = (end_group - first_group + PREFIX_THREADS - 1u) / PREFIX_THREADS;
  let begin = min(first_group + lane * groups, end_group);
  let end = min(begin + groups, end_group);
  // A segment that the costs do not reach begins and ends behind them.
  for (var nth = lane; nth < count; nth += PREFIX_THREADS) {
    let at = segment_at(view, first_segment + nth);
    bin_order[at] = tile;
    bin_order[at + 1u] = nth | (count << 16u);
    bin_order[at + 2u] = select(words.y, words.x, nth == 0u);
    bin_order[at + 3u] = words.y;
    bin_order[at + 4u] = nth * size;
  }
  var own = 0u;
  for (var group = begin; group < end; group++) { own += cost_of(group, tile, words); }
  // Its barriers come before the words that follow.
  var sum = inclusive_sum(own, lane, PREFIX_THREADS) - own;
  storageBarrier();
  // The next end of a segment at or behind the sum.
  var nth = max((sum + size - 1u) / size, 1u);
  for (var group = begin; group < end; group++) {
    sum += cost_of(group, tile, words);
    while (nth < count && nth * size < sum) {
      let at = segment_at(view, first_segment + nth);
      let word = min((group + 1u) * PAIR_WORDS, words.y);
      bin_order[at + 2u] = word;
      bin_order[at + 3u - SEGMENT_WORDS] = word;
      nth++;
    }
  }
}
