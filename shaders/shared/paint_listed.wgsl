// How a pixel takes the splats of a batch: as they are listed, by the depth of their centres. Whoever imports this says what is noted on the way
// (`note_blend`) and what is hidden (`is_hidden`).
#import shared/paint_tiles

// Red and green in float16; blue in float32, or where notes are taken blue and depth, as in ProjectedSplat.
fn packed_color(s: ProjectedSplat, slot: u32) -> vec2u {
  return vec2u(s.paint.y, select(bitcast<u32>(splat_color(s).b), s.paint.z, NOTES_SPLATS));
}

fn blue_of(brush: Brush) -> f32 {
  if (NOTES_SPLATS) { return unpack2x16float(brush.color.y).x; }
  return bitcast<f32>(brush.color.y);
}

// Blends splat k of the batch. Without a branch, which takes a third more time: where the splat does not reach, and where the pixel is finished, nothing
// is added.
fn blend(pixel: ptr<function, Pixel>, k: u32, brush: Brush, place: vec2f, least_power: f32) {
  let u = brush.u_x * place.x + brush.u_0;
  let v = brush.v_x * place.x + (brush.v_y * place.y + brush.v_0);
  let power = brush.power - u * u - v * v;
  let reaches = power >= least_power;
  let alpha = select(0.0, min(ALPHA_MAX, exp2(power)), reaches);
  // Those behind a hidden one are hidden, too.
  (*pixel).least = select((*pixel).least, FINISHED, is_hidden(k));
  let before = (*pixel).transmittance;
  let full_weight = before * alpha;
  let remaining = before - full_weight;
  let ends = remaining <= (*pixel).least;
  var refuses = ends;
  if (!refuses_last) { refuses = remaining <= REFUSED || is_finished(*pixel); }
  (*pixel).least = select((*pixel).least, FINISHED, ends);
  let after = select(remaining, before, refuses);
  let weight = select(full_weight, 0.0, refuses);
  note_blend(k, weight, before, after, brush.color.y);
  (*pixel).color += weight * vec3f(unpack2x16float(brush.color.x), blue_of(brush));
  (*pixel).transmittance = after;
}

fn paint_batch(pixel: ptr<function, Pixel>, own_block: u32, place: vec2f, least_power: f32) {
  for (var word = 0u; word < BATCH_WORDS; word++) {
    if (is_finished(*pixel)) { break; }
    // Of these 32 splats those that touch the block, two at once: the second is read while the first is blended.
    var ahead = atomicLoad(&block_hits[own_block * BATCH_WORDS + word]);
    while (ahead > 0u) {
      let k = word * 32u + zeros_below(ahead);
      ahead &= ahead - 1u;
      let next = select(NO_SPLAT, word * 32u + zeros_below(ahead), ahead != 0u);
      ahead &= ahead - 1u;
      let brush = brushes[k];
      let next_brush = brushes[next];
      blend(pixel, k, brush, place, least_power);
      blend(pixel, next, next_brush, place, least_power);
    }
  }
}

fn paint_rest(pixel: ptr<function, Pixel>) {}
