// Sums stop at the largest number: one that wrapped around would look like room for everything.
fn add_saturating(a: u32, b: u32) -> u32 {
  let sum = a + b;
  return select(sum, 0xffffffffu, sum < a);
}
