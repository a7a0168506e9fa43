// Zeros below the lowest set bit; 32 if none is set. Some compilers turn firstTrailingBit and countTrailingZeros into
// two dozen instructions, and this into three.
fn zeros_below(bits: u32) -> u32 {
  return countOneBits(~bits & (bits - 1u));
}
