// Depth of a pixel: that of the splat that halves its transmittance.
#import shared/paint_columns

// For the splats of the batch and the placeholder.
var<workgroup> batch_depths: array<f32, BATCH + 1u>;
var<private> half_depth: Column;

fn note_depth(k: u32, before: Column, after: Column, is_blended: Flags) {
  let is_half = is_blended & (before > Column(0.5)) & (after <= Column(0.5));
  half_depth = select(half_depth, Column(batch_depths[k]), is_half);
}
fn keep_depth(depth: Column) { half_depth = depth; }
fn kept_depth() -> Column { return half_depth; }
