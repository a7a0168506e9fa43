// Finds exactly which rectangles of pixels the visible part of a splat, the ellipse with alpha >= ALPHA_MIN, touches.
#import shared/splat
#import shared/falloff

// Callers enlarge a band by this many pixels, because rounding must not lose a pixel on the rim.
const RIM = 0.01;
// Beyond this variance, px², a splat covers every image; the square root of infinity would be useless.
const VARIANCE_MAX = 1e36;

// The ellipse u² + v² <= radius², prepared for tests against horizontal bands.
struct Coverage {
  center: vec2f,
  // Half width and half height in pixels.
  extent: vec2f,
  // dx/dy of the line through the midpoints of all horizontal chords.
  lean: f32,
  // Half length of the longest chord, which passes through the center.
  half_chord: f32,
  // Height above the center of the rightmost point.
  rightmost_y: f32,
  // 1 / extent.y
  inverse_height: f32,
}

fn coverage_of(s: ProjectedSplat) -> Coverage {
  let sigma_x = 1.0 / s.shape.z;
  let slope = s.shape.w;
  let sigma_v = 1.0 / bitcast<f32>(s.paint.x);
  let radius = cutoff_radius(bitcast<f32>(s.paint.w));
  let sheared = slope * sigma_x;
  // Divisions dominate the cost: there is one here, for all bands.
  let variance_y = min(sheared * sheared + sigma_v * sigma_v, VARIANCE_MAX);
  let inverse_sigma_y = inverseSqrt(variance_y);
  let sigma_y = variance_y * inverse_sigma_y;
  let extent = radius * vec2f(sigma_x, sigma_y);
  return Coverage(
    s.shape.xy,
    extent,
    sheared * sigma_x * inverse_sigma_y * inverse_sigma_y,
    extent.x * sigma_v * inverse_sigma_y,
    radius * sheared,
    inverse_sigma_y / max(radius, 1e-20),
  );
}

// Range of x, in pixels, of the part of the ellipse between y = top and y = bottom; empty (first > last) if there is none.
fn band_range(c: Coverage, top: f32, bottom: f32) -> vec2f {
  let from_y = max(top - c.center.y, -c.extent.y);
  let to_y = min(bottom - c.center.y, c.extent.y);
  if (from_y > to_y) { return vec2f(1.0, -1.0); }
  // The outermost points of the whole ellipse lie at these heights; a band without them is widest at its nearest edge.
  let right = chord_end(c, clamp(c.rightmost_y, from_y, to_y), 1.0);
  let left = chord_end(c, clamp(-c.rightmost_y, from_y, to_y), -1.0);
  return c.center.x + vec2f(left, right);
}

// Right (side 1) or left (side -1) end of the chord at height y, relative to the center.
fn chord_end(c: Coverage, y: f32, side: f32) -> f32 {
  let t = y * c.inverse_height;
  return c.lean * y + side * c.half_chord * sqrt(max(0.0, 1.0 - t * t));
}
