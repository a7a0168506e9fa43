// Potentially visible sets: from how far around the scene each splat can be seen. A row of bits for each direction that the scene was looked at from, four words
// of 32 directions a splat: word w of splat i is seen_from[w · stride + i], so that neighbours are read together.
#import shared/view

const SIDES = 128u;
const SIDE_WORDS = SIDES / 32u;

// Word of a splat among those of `length` words.
fn side_word(length: u32, word: u32, splat: u32) -> u32 {
  return word * (length / SIDE_WORDS) + splat;
}
