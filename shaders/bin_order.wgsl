// Orders bins by their number of pairs, largest first, so that no long bin starts last. Bins whose numbers differ by
// less than a fifth come in any order.
#import shared/bins
#import shared/prefix
#import shared/undivided

@group(0) @binding(0) var<uniform> view: BinView;
@group(0) @binding(1) var<storage, read> ranges: array<vec2u>;
// Followed by the number of long bins, and the number of pairs of the longest.
@group(0) @binding(2) var<storage, read_write> bin_order: array<u32>;

// There are four classes for each doubling of the number of pairs.
// Exponent and first two bits of the mantissa of the float32 2^31, which is more pairs than a buffer holds, and 3.
const LONGEST = 635u;
// Zero at the beginning, as WGSL says. By class: its number of bins, then the place of its first bin.
var<workgroup> places: array<atomic<u32>, PREFIX_THREADS>;
var<workgroup> pairs: atomic<u32>;
var<workgroup> longest: atomic<u32>;

fn pairs_of(bin: u32) -> u32 { return ranges[bin].y - ranges[bin].x; }

// The class counted from the longest list: 127 for one pair or none.
fn class_of(count: u32) -> u32 { return LONGEST - (bitcast<u32>(f32(max(count, 1u))) >> 21u); }

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(local_invocation_index) lane: u32) {
  let bins = view.bins.x * view.bins.y;
  for (var bin = lane; bin < bins; bin += PREFIX_THREADS) {
    let count = pairs_of(bin);
    atomicAdd(&places[class_of(count)], 1u);
    atomicAdd(&pairs, count);
    atomicMax(&longest, count);
  }
  workgroupBarrier();
  let own = atomicLoad(&places[lane]);
  let upto = inclusive_sum(own, lane, PREFIX_THREADS);
  atomicStore(&places[lane], upto - own);
  if (lane == class_of(atomicLoad(&pairs) / LONG_BINS)) { bin_order[bins] = upto - own; }
  workgroupBarrier();
  for (var bin = lane; bin < bins; bin += PREFIX_THREADS) {
    bin_order[atomicAdd(&places[class_of(pairs_of(bin))], 1u)] = bin;
  }
  if (lane == 0u) { bin_order[bins + 1u] = atomicLoad(&longest); }
  divide_lists(lane);
}
