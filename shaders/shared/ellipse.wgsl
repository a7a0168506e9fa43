// The screen Gaussian in the form exp(-(u² + v²) / 2) with u = dx / sigma_x, v = (dy - slope dx) / sigma_v: the
// Cholesky factor of its inverse covariance. It stays exact for needles, whose conic loses all digits in float32.
struct Ellipse {
  // Pixels.
  center: vec2f,
  // Camera z in world units.
  depth: f32,
  // Standard deviation along x, in pixels.
  sigma_x: f32,
  // dy/dx of the regression line of y on x.
  slope: f32,
  // Standard deviation of y about that line, in pixels.
  sigma_v: f32,
  // Opacity after compensation.
  opacity: f32,
}
