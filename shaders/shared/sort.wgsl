// Definitions shared by the three kernels of the radix sort.
struct SortPass {
  // Lowest bit of the digit.
  shift: u32,
  // 1 if the values of this pass are the indices of its keys.
  makes_indices: u32,
}

const SORT_THREADS = 256u;
// Number of values of an 8-bit digit: one for each thread.
const DIGITS = 256u;

fn digit_of(key: u32, shift: u32) -> u32 {
  return (key >> shift) & (DIGITS - 1u);
}
