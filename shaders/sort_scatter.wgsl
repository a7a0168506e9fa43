// Last third: every key moves to its place. Within a block keys are ranked 256 at a time by a bitmap for each digit,
// which needs no subgroups, keeps equal digits in order (stable), and waits for no other workgroup.
#import shared/sort_places

const WORDS = SORT_THREADS / 32u;

// Bit t of [word][digit]: thread 32·word + t of this round has the digit. Threads that walk over digits side by side
// then touch neighbouring words.
var<workgroup> members: array<atomic<u32>, DIGITS * WORDS>;

@compute @workgroup_size(SORT_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let block_id = group_index(workgroup_id);
  find_first_places(block_id, lane);
  let word = lane / 32u;
  let bit = 1u << (lane % 32u);
  var coming = item_at(block_id * SORT_BLOCK + lane);
  for (var start = 0u; start < SORT_BLOCK; start += SORT_THREADS) {
    let i = block_id * SORT_BLOCK + start + lane;
    let is_key = i < plan.visible;
    let key = coming.key;
    let value = coming.value;
    // The next round's, which are on their way while this round ranks.
    if (start + SORT_THREADS < SORT_BLOCK) { coming = item_at(i + SORT_THREADS); }
    let digit = digit_of(key, digit_pass.shift);
    if (is_key) { atomicOr(&members[word * DIGITS + digit], bit); }
    workgroupBarrier();

    let first = next[digit];
    var before = 0u;
    var count = 0u;
    for (var w = 0u; w < WORDS; w++) {
      let mask = atomicLoad(&members[w * DIGITS + digit]);
      count += countOneBits(mask);
      before += select(0u, countOneBits(mask), w < word) + select(0u, countOneBits(mask & (bit - 1u)), w == word);
    }
    let place = first + before;
    if (is_key && place < plan.visible) {
      keys_out[place] = key;
      values_out[place] = value;
    }
    workgroupBarrier();

    // The last thread with a digit leaves the bitmap of that digit empty for the next round.
    if (is_key && before == count - 1u) {
      next[digit] = first + count;
      for (var w = 0u; w < WORDS; w++) { atomicStore(&members[w * DIGITS + digit], 0u); }
    }
    workgroupBarrier();
  }
}
