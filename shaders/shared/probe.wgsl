// A point of the image that is asked about, and what a splat does to the light there.
#import shared/splat
#import shared/falloff

struct ProbePoint {
  // Pixels of the image that was drawn.
  pixel: vec2f,
  // World units along the camera's axis.
  depth: f32,
}

// Share of the light that a splat lets through at a pixel.
fn passes(s: ProjectedSplat, point: ProbePoint) -> f32 {
  let alpha = alpha_at(point.pixel - s.shape.xy, s.shape.z, s.shape.w, bitcast<f32>(s.paint.x), bitcast<f32>(s.paint.w));
  return select(1.0, 1.0 - alpha, alpha >= ALPHA_MIN);
}
