// Where the keys of a block go: for each digit the place of the next key that has it.
#import shared/sort_scatter
#import shared/prefix

var<workgroup> next: array<u32, DIGITS>;

// next[digit] = keys with smaller digits + keys with this digit in earlier blocks. Ends with a barrier.
fn find_first_places(block_id: u32, lane: u32) {
  var own = 0u;
  if (lane < DIGITS) { own = digit_totals[lane]; }
  let smaller = inclusive_sum(own, lane, DIGITS) - own;
  if (lane < DIGITS) { next[lane] = smaller + block_offsets[lane * plan.sort_blocks + block_id]; }
  workgroupBarrier();
}
