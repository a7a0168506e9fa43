// Last third: moves every key to its place. Within a block keys are ranked 256 at a time by a bitmap for each digit,
// which needs no subgroups, keeps equal digits in order (stable), and waits for no other workgroup.
#import shared/sort_offsets

const WORDS = SORT_THREADS / 32u;

// Keys with each digit in the previous rounds.
var<workgroup> ranked: array<u32, DIGITS>;

@compute @workgroup_size(SORT_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let block_id = group_index(workgroup_id);
  if (block_id >= plan.sort_blocks) { return; }
  let own_first = block_id * SORT_BLOCK + lane;
  var keys = items_at(own_first, SORT_THREADS);
  var places: Items;
  let own_word = lane / 32u;
  let bit = 1u << (lane % 32u);
  for (var r = 0u; r < ITEMS; r++) {
    let is_key = own_first + r * SORT_THREADS < plan.visible;
    let digit = digit_of(keys[r], digit_pass.shift);
    // Bit t of [word][digit]: thread 32·word + t of this round has the digit. Neighboring threads that iterate over
    // digits then access neighboring words.
    if (is_key) { atomicOr(&exchange[own_word * DIGITS + digit], bit); }
    workgroupBarrier();

    let first = ranked[digit];
    var before = 0u;
    var count = 0u;
    for (var w = 0u; w < WORDS; w++) {
      let mask = atomicLoad(&exchange[w * DIGITS + digit]);
      count += countOneBits(mask);
      before += select(0u, countOneBits(mask), w < own_word) + select(0u, countOneBits(mask & (bit - 1u)), w == own_word);
    }
    places[r] = first + before;
    workgroupBarrier();

    // The last thread with a digit clears the bitmap of that digit for the next round.
    if (is_key && before == count - 1u) {
      ranked[digit] = first + count;
      for (var w = 0u; w < WORDS; w++) { atomicStore(&exchange[w * DIGITS + digit], 0u); }
    }
    workgroupBarrier();
  }
  find_first_places(block_id, lane, ranked[lane]);
  for (var r = 0u; r < ITEMS; r++) { places[r] += first_in_block[digit_of(keys[r], digit_pass.shift)]; }
  write_items(block_id, lane, own_first, SORT_THREADS, &keys, &places);
}
