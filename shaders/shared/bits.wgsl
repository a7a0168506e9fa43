// Zeros below the lowest bit that is set; 32 if none is. For some targets compilers make two dozen instructions of firstTrailingBit and
// countTrailingZeros, and three of this.
fn zeros_below(bits: u32) -> u32 {
  return countOneBits(~bits & (bits - 1u));
}
