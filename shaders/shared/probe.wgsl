// A probed point of the image, and the transmittance of a splat at it.
#import shared/splat
#import shared/falloff

struct ProbePoint {
  // Position in pixels of the drawn image.
  pixel: vec2f,
  // World units along the optical axis.
  depth: f32,
}

// Fraction of the light that a splat transmits at a pixel.
fn passes(s: ProjectedSplat, point: ProbePoint) -> f32 {
  let alpha = alpha_at(point.pixel - s.shape.xy, s.shape.z, s.shape.w, bitcast<f32>(s.paint.x), bitcast<f32>(s.paint.w));
  return select(1.0, 1.0 - alpha, alpha >= ALPHA_MIN);
}
