// Replaces `may_be_visible`, because splats that a modifier moves may be visible outside their chunk.
#import shared/chunk_visibility
#import shared/modifiers

fn may_be_modified(view: View, c: Chunk) -> bool {
  if (modifiers.moves != 0u) { return all(c.low <= c.high); }
  return may_be_visible(view, c);
}
