// In place of `may_be_visible`: splats that a page moves may be seen where their chunk is not.
#import shared/chunk_visibility
#import shared/modifiers

fn may_be_modified(view: View, c: Chunk) -> bool {
  if (modifiers.moves != 0u) { return all(c.low <= c.high); }
  return may_be_visible(view, c);
}
