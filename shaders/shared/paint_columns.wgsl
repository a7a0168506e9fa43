// Blends the splats of a batch into the pixels of a thread, in the order of their center depths. Work that does not
// depend on the pixel is done once for all of a column. The importing module defines how splats are hidden
// (`start_hiding`, `hide`, `hide_rest`) and which auxiliary outputs are written (`aux_blend`, `aux_pixel`).
#import shared/paint_tiles
#import shared/column

struct Pixels {
  red: Column,
  green: Column,
  blue: Column,
  // Transmittance of all splats until here, and of the blended ones. They differ once a pixel is finished: the first
  // keeps falling, so the comparison that rejects one splat rejects all later ones.
  light: Column,
  transmittance: Column,
}

// Red and green in float16; blue in float32.
fn packed_color(s: ProjectedSplat, slot: u32) -> vec2u {
  return vec2u(s.paint.y, bitcast<u32>(splat_color(s).b));
}

fn start_pixels(position: vec2u) -> Pixels {
  let is_inside = f32(position.x) < view.viewport.x;
  let are_inside = Flags(is_inside) & (f32(position.y) + STEPS < Column(view.viewport.y));
  if (is_inside) { start_hiding(position); }
  let light = select(Column(0.0), Column(1.0), are_inside);
  return Pixels(Column(0.0), Column(0.0), Column(0.0), light, light);
}

fn are_finished(pixels: Pixels) -> bool {
  return all(pixels.light <= Column(view.transmittance_min));
}

// Blends splat k of the batch. It has no branch, which would take a third more time: splats that miss the pixel and
// finished pixels add zero.
fn blend(pixels: ptr<function, Pixels>, k: u32, place: vec2f, min_power: f32) {
  let axis = axes[k];
  let paint = paints[k];
  let u = axis.x * place.x + axis.y;
  let v = axis.w * (place.y + STEPS) + (axis.z * place.x + bitcast<f32>(paint.x));
  let power = (bitcast<f32>(paint.y) - u * u) - v * v;
  let alpha = select(Column(0.0), min(Column(ALPHA_MAX), exp2(power)), power >= Column(min_power));
  hide(pixels, k);
  let before = (*pixels).transmittance;
  let light = (*pixels).light;
  let after = light - light * alpha;
  var is_blended = after > Column(view.transmittance_min);
  if (!refuses_last) { is_blended = (after > Column(REFUSED)) & (light > Column(view.transmittance_min)); }
  let behind = select(before, after, is_blended);
  // A difference, so that one selection serves weight and transmittance.
  let weight = before - behind;
  let red_green = unpack2x16float(paint.z);
  (*pixels).red += weight * red_green.x;
  (*pixels).green += weight * red_green.y;
  (*pixels).blue += weight * bitcast<f32>(paint.w);
  (*pixels).light = after;
  (*pixels).transmittance = behind;
  aux_blend(k, weight, before, after, is_blended);
}

fn paint_batch(pixels: ptr<function, Pixels>, own_block: u32, place: vec2f, min_power: f32) {
  for (var word = 0u; word < BATCH_WORDS; word++) {
    if (are_finished(*pixels)) { break; }
    // Visits those of these 32 splats that touch the block, two at a time: the second is loaded while the first is
    // blended.
    var ahead = atomicLoad(&block_hits[own_block * BATCH_WORDS + word]);
    while (ahead > 0u) {
      let k = word * 32u + zeros_below(ahead);
      ahead &= ahead - 1u;
      let next = select(NO_SPLAT, word * 32u + zeros_below(ahead), ahead != 0u);
      ahead &= ahead - 1u;
      blend(pixels, k, place, min_power);
      blend(pixels, next, place, min_power);
    }
  }
}

// Nothing of a pixel refers to the batch.
fn carry_pixels(pixels: ptr<function, Pixels>, place: vec2f) {}
