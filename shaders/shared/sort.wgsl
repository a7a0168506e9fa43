// What the three kernels of the radix sort share.
struct SortPass {
  // Lowest bit of the digit.
  shift: u32,
  // 1 if the values of this pass are the indices of its keys.
  makes_indices: u32,
}

const SORT_THREADS = 256u;
// Values of a digit of 8 bits: one a thread.
const DIGITS = 256u;

fn digit_of(key: u32, shift: u32) -> u32 {
  return (key >> shift) & (DIGITS - 1u);
}
