// Fractions of the light that are left behind the layers of a probe, from near to far.
const PROBE_LEVELS = 16u;
// Level of the visible surface: half of the light.
const PROBE_MIDDLE = 4u;

// 0.9, 0.8, ... 0.1, then halves.
fn light_left(level: u32) -> f32 {
  let n = f32(level);
  return select(0.1 * exp2(8.0 - n), (9.0 - n) * 0.1, level < 9u);
}
