// `sort_scatter` for devices with subgroups: keys with the same digit find each other by votes, one for each bit. Threads of a subgroup
// must be neighbours in the workgroup; where they are not, the known answer of the probe rules this variant out.
#import shared/sort_places

// Subgroups of a workgroup, at most: replaced by what the device has.
const SUBGROUPS = 8u;

// [subgroup][digit] keys of this round in the lower half, the number of the round in the upper.
var<workgroup> counts: array<u32, DIGITS * SUBGROUPS>;

// The threads of the subgroup whose keys have this digit.
fn peers_of(digit: u32, is_key: bool) -> vec4u {
  var peers = subgroupBallot(is_key);
  for (var b = 0u; b < DIGIT_BITS; b++) {
    let is_set = ((digit >> b) & 1u) != 0u;
    let votes = subgroupBallot(is_set);
    peers &= select(~votes, votes, is_set);
  }
  return peers;
}

fn ones(mask: vec4u) -> u32 {
  let each = countOneBits(mask);
  return each.x + each.y + each.z + each.w;
}

// A bit for each thread of the subgroup before this one.
fn threads_before(own: u32) -> vec4u {
  let bits = clamp(vec4i(i32(own)) - vec4i(0, 32, 64, 96), vec4i(0), vec4i(32));
  return select((vec4u(1u) << vec4u(bits % 32)) - 1u, vec4u(0xffffffffu), bits == vec4i(32));
}

@compute @workgroup_size(SORT_THREADS)
fn main(
  @builtin(workgroup_id) workgroup_id: vec3u,
  @builtin(local_invocation_index) lane: u32,
  @builtin(subgroup_size) subgroup_size: u32,
  @builtin(subgroup_invocation_id) own: u32,
) {
  let block_id = group_index(workgroup_id);
  find_first_places(block_id, lane);
  let subgroup = lane / subgroup_size;
  let subgroups = SORT_THREADS / subgroup_size;
  var coming = item_at(block_id * SORT_BLOCK + lane);
  for (var round = 0u; round < SORT_BLOCK / SORT_THREADS; round++) {
    let i = block_id * SORT_BLOCK + round * SORT_THREADS + lane;
    let is_key = i < plan.visible;
    let key = coming.key;
    let value = coming.value;
    // The next round's, which are on their way while this round ranks.
    if (round + 1u < SORT_BLOCK / SORT_THREADS) { coming = item_at(i + SORT_THREADS); }
    let digit = digit_of(key, digit_pass.shift);
    let peers = peers_of(digit, is_key);
    let rank = ones(peers & threads_before(own));
    let stamp = (round + 1u) << 16u;
    if (is_key && rank == 0u) { counts[subgroup * DIGITS + digit] = stamp | ones(peers); }
    workgroupBarrier();

    let first = next[digit];
    var before = 0u;
    var total = 0u;
    for (var s = 0u; s < subgroups; s++) {
      let count = counts[s * DIGITS + digit] ^ stamp;
      // What another round has left there differs in the upper half.
      if (count > 0xffffu) { continue; }
      total += count;
      before += select(0u, count, s < subgroup);
    }
    let place = first + before + rank;
    if (is_key && place < plan.visible) {
      keys_out[place] = key;
      values_out[place] = value;
    }
    workgroupBarrier();
    // The first thread with a digit moves its place on; the next round reads it behind its own barrier.
    if (is_key && before + rank == 0u) { next[digit] = first + total; }
  }
}
