// `sort_scatter` for devices with subgroups: keys with the same digit find each other by votes, one for each bit, and each subgroup ranks a
// part of the block by itself. Threads of a subgroup must be neighbours in the workgroup and run in step; where they do not, the known answer
// of the probe rules this variant out.
#import shared/sort_places
#import shared/bits

// Subgroups of a workgroup at most, and words with a bit for each thread of a subgroup: replaced by what the device has.
const SUBGROUPS = 8u;
const VOTE_WORDS = 4u;

alias Votes = array<u32, VOTE_WORDS>;

// The threads of the subgroup whose keys have this digit.
fn peers_of(digit: u32, is_key: bool) -> Votes {
  var peers: Votes;
  let voters = subgroupBallot(is_key);
  for (var w = 0u; w < VOTE_WORDS; w++) { peers[w] = voters[w]; }
  for (var b = 0u; b < DIGIT_BITS; b++) {
    let is_set = ((digit >> b) & 1u) != 0u;
    let votes = subgroupBallot(is_set);
    for (var w = 0u; w < VOTE_WORDS; w++) { peers[w] &= select(~votes[w], votes[w], is_set); }
  }
  return peers;
}

struct Peers {
  count: u32,
  // Those in threads before the own one.
  before: u32,
  // Thread of the first.
  first: u32,
}

fn count_peers(peers: Votes, own: u32) -> Peers {
  var count = 0u;
  var before = 0u;
  var first = 0u;
  for (var w = 0u; w < VOTE_WORDS; w++) {
    let mask = peers[w];
    if (count == 0u && mask != 0u) { first = 32u * w + zeros_below(mask); }
    count += countOneBits(mask);
    let threads_before = clamp(i32(own) - i32(32u * w), 0, 32);
    let upto = select((1u << u32(threads_before % 32)) - 1u, 0xffffffffu, threads_before == 32);
    before += countOneBits(mask & upto);
  }
  return Peers(count, before, first);
}

@compute @workgroup_size(SORT_THREADS)
fn main(
  @builtin(workgroup_id) workgroup_id: vec3u,
  @builtin(local_invocation_index) lane: u32,
  @builtin(subgroup_size) subgroup_size: u32,
  @builtin(subgroup_invocation_id) own: u32,
) {
  let block_id = group_index(workgroup_id);
  let subgroup = lane / subgroup_size;
  let own_first = block_id * SORT_BLOCK + subgroup * subgroup_size * ITEMS + own;
  var keys = items_at(own_first, subgroup_size);
  var places: Items;
  // `exchange` holds the keys of the rounds before: [subgroup][digit].
  for (var r = 0u; r < ITEMS; r++) {
    let is_key = own_first + r * subgroup_size < plan.visible;
    let digit = digit_of(keys[r], digit_pass.shift);
    let peers = count_peers(peers_of(digit, is_key), own);
    var ranked = 0u;
    if (is_key && own == peers.first) { ranked = atomicAdd(&exchange[subgroup * DIGITS + digit], peers.count); }
    places[r] = subgroupShuffle(ranked, select(own, peers.first, is_key)) + peers.before;
  }
  workgroupBarrier();

  // What subgroups before have ranked.
  var count = 0u;
  if (lane < DIGITS) {
    for (var s = 0u; s < SUBGROUPS; s++) {
      let ranked = atomicLoad(&exchange[s * DIGITS + lane]);
      atomicStore(&exchange[s * DIGITS + lane], count);
      count += ranked;
    }
  }
  find_first_places(block_id, lane, count);
  for (var r = 0u; r < ITEMS; r++) {
    let digit = digit_of(keys[r], digit_pass.shift);
    places[r] += first_in_block[digit] + atomicLoad(&exchange[subgroup * DIGITS + digit]);
  }
  workgroupBarrier();
  write_items(block_id, lane, own_first, subgroup_size, &keys, &places);
}
