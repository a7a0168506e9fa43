// Orders bins by their number of pairs, largest first, so that no long bin starts last. Bins whose numbers differ by
// less than a fifth come in any order.
#import shared/bins
#import shared/prefix

@group(0) @binding(0) var<uniform> view: BinView;
@group(0) @binding(1) var<storage, read> ranges: array<vec2u>;
@group(0) @binding(2) var<storage, read_write> bin_order: array<u32>;

// Four classes for each doubling of the number of pairs.
const ORDER_CLASSES = 128u;
// The class of a list with one pair, if classes were counted from the shortest list.
const FIRST_CLASS = 508u;
var<workgroup> places: array<atomic<u32>, ORDER_CLASSES>;

// The class counted from the longest list: exponent and first two bits of the mantissa of a float32.
fn class_of(bin: u32) -> u32 {
  let range = ranges[bin];
  let quarters = (bitcast<u32>(f32(max(range.y - range.x, 1u))) >> 21u) - FIRST_CLASS;
  return ORDER_CLASSES - 1u - min(quarters, ORDER_CLASSES - 1u);
}

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(local_invocation_index) lane: u32) {
  let bins = view.bins.x * view.bins.y;
  if (lane < ORDER_CLASSES) { atomicStore(&places[lane], 0u); }
  workgroupBarrier();
  for (var bin = lane; bin < bins; bin += PREFIX_THREADS) { atomicAdd(&places[class_of(bin)], 1u); }
  workgroupBarrier();
  var own = 0u;
  if (lane < ORDER_CLASSES) { own = atomicLoad(&places[lane]); }
  let upto = inclusive_sum(own, lane, PREFIX_THREADS);
  if (lane < ORDER_CLASSES) { atomicStore(&places[lane], upto - own); }
  workgroupBarrier();
  for (var bin = lane; bin < bins; bin += PREFIX_THREADS) { bin_order[atomicAdd(&places[class_of(bin)], 1u)] = bin; }
}
