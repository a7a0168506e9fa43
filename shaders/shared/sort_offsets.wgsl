// Writes a block of keys. The block is sorted in workgroup memory first, so that keys with the same digit are
// contiguous and are written together: scattered writes would cost a memory transaction each.
#import shared/sort_scatter
#import shared/prefix

// Keys of one thread.
const ITEMS = SORT_BLOCK / SORT_THREADS;
alias Items = array<u32, ITEMS>;

// One bit for each digit and thread while keys are ranked; afterwards words exchanged between threads, SORT_BLOCK at most.
const EXCHANGE_WORDS = SORT_THREADS / 32u * DIGITS;
var<workgroup> exchange: array<atomic<u32>, EXCHANGE_WORDS>;
// For each digit the index in the block of its first key, and the offset from an index in the block to the index among
// all keys.
var<workgroup> first_in_block: array<u32, DIGITS>;
var<workgroup> to_all: array<u32, DIGITS>;

// `count` is the number of keys in the block with digit `lane`. Ends with a barrier.
fn find_first_places(block_id: u32, lane: u32, count: u32) {
  let before = inclusive_sum(count, lane, DIGITS) - count;
  let total = digit_totals[lane];
  let smaller = inclusive_sum(total, lane, DIGITS) - total;
  first_in_block[lane] = before;
  // Keys with smaller digits, and keys with this digit in earlier blocks.
  to_all[lane] = smaller + block_offsets[block_id * DIGITS + lane] - before;
  workgroupBarrier();
}

// Writes keys number first, first + step, ... of the list, whose places in the block are known. Places out of range,
// which only a wrong rank produces, are not written.
fn write_items(block_id: u32, lane: u32, first: u32, step: u32, keys: ptr<function, Items>, places: ptr<function, Items>) {
  let first_of_block = block_id * SORT_BLOCK;
  let length = min(plan.visible - min(first_of_block, plan.visible), SORT_BLOCK);
  for (var r = 0u; r < ITEMS; r++) {
    if (first + r * step < plan.visible) { atomicStore(&exchange[(*places)[r]], (*keys)[r]); }
  }
  workgroupBarrier();
  var goals: Items;
  for (var r = 0u; r < ITEMS; r++) {
    let place = r * SORT_THREADS + lane;
    goals[r] = plan.visible;
    if (place >= length) { continue; }
    let key = atomicLoad(&exchange[place]);
    goals[r] = to_all[digit_of(key, digit_pass.shift)] + place;
    if (goals[r] < plan.visible) { keys_out[goals[r]] = key; }
  }
  // Loads are issued before the barrier, so that they overlap with waiting.
  var own: Items;
  for (var r = 0u; r < ITEMS; r++) {
    let i = first + r * step;
    if (i < plan.visible) { own[r] = value_of(i); }
  }
  workgroupBarrier();
  for (var r = 0u; r < ITEMS; r++) {
    if (first + r * step < plan.visible) { atomicStore(&exchange[(*places)[r]], own[r]); }
  }
  workgroupBarrier();
  for (var r = 0u; r < ITEMS; r++) {
    if (goals[r] < plan.visible) { values_out[goals[r]] = atomicLoad(&exchange[r * SORT_THREADS + lane]); }
  }
}

// Keys number first, first + step, ... of the list, up to its end.
fn items_at(first: u32, step: u32) -> Items {
  var keys: Items;
  for (var r = 0u; r < ITEMS; r++) {
    let i = first + r * step;
    if (i < plan.visible) { keys[r] = keys_in[i]; }
  }
  return keys;
}
