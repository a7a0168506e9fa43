// Saturates at the largest number, because a sum that wrapped around would look like free capacity.
fn add_saturating(a: u32, b: u32) -> u32 {
  let sum = a + b;
  return select(sum, 0xffffffffu, sum < a);
}
