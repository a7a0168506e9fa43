// 3D Gaussian to screen ellipse: EWA splatting (Zwicker et al. 2001) with the constants of 3D Gaussian Splatting
// (Kerbl et al. 2023) and the asymmetric Jacobian clamp of gsplat.
#import shared/view
#import shared/gaussian
#import shared/falloff
#import shared/ellipse
#import shared/cull_stats

// Variance that the low-pass filter of 3D Gaussian Splatting adds, in px² of the displayed frame.
const DILATION = 0.3;
// Minimum opacity compensation of an antialiased scene.
const COMPENSATION_MIN = 0.005;

fn is_in_depth_range(view: View, depth: f32) -> bool {
  return depth >= view.near && depth <= view.far;
}

fn project_ellipse(view: View, g: Gaussian) -> Ellipse {
  var p = in_camera(view, g.position);
  // `project` may round a splat that `cull` found at the near plane to less, or even to a depth of zero or below if
  // that plane is very near.
  p.z = max(p.z, view.near);
  // Divisor of the perspective projection.
  let shrink = select(p.z, 1.0, view.is_orthographic != 0u);
  let xy = p.xy / shrink;
  let t = clamp(xy, view.jacobian_min, view.jacobian_max);

  // Rows of J · W · L, a square root of the screen covariance, whose products would lose digits too early.
  let to_camera = mat3x3f(view.local_to_camera[0].xyz, view.local_to_camera[1].xyz, view.local_to_camera[2].xyz);
  let axes = mat3x3f(
    to_camera * g.factor_x,
    to_camera[1] * g.factor_y.x + to_camera[2] * g.factor_y.y,
    to_camera[2] * g.factor_z,
  );
  let a = transpose(axes);
  let row_x = (a[0] - t.x * a[2]) * (view.focal.x / shrink);
  let row_y = (a[1] - t.y * a[2]) * (view.focal.y / shrink);

  let xx = dot(row_x, row_x);
  let yy = dot(row_y, row_y);
  let variance_x = xx + view.filter_variance;
  let inverse_sigma_x = inverseSqrt(variance_x);
  // The determinant before dilation is |row_x × row_y|² (Cauchy-Binet), a sum of squares without cancellation.
  let minors = cross(row_x * inverse_sigma_x, row_y);
  let own_variance_v = dot(minors, minors);
  let variance_v = own_variance_v + view.filter_variance * (variance_x + yy) / variance_x;

  var opacity = g.opacity;
  if (view.antialiased != 0u) {
    opacity *= max(COMPENSATION_MIN, sqrt(own_variance_v / variance_v));
  }
  return Ellipse(
    xy * view.focal + view.principal,
    p.z,
    sqrt(variance_x),
    dot(row_x, row_y) / variance_x,
    sqrt(variance_v),
    opacity,
  );
}

// Half width and half height, in pixels, of the box of all points with alpha >= ALPHA_MIN.
fn half_extent(view: View, e: Ellipse) -> vec2f {
  let radius = cutoff_radius(e.opacity);
  let sheared = e.slope * e.sigma_x;
  return radius * vec2f(e.sigma_x, sqrt(sheared * sheared + e.sigma_v * e.sigma_v));
}

// Columns and rows of the image whose pixel centers lie in the box of the ellipse; 0 in both if there are none.
fn covered_box(view: View, e: Ellipse) -> vec2f {
  let extent = half_extent(view, e);
  let first = max(ceil(e.center - extent - 0.5), vec2f(0.0));
  let last = min(floor(e.center + extent - 0.5), view.viewport - 1.0);
  return select(vec2f(0.0), last - first + 1.0, e.opacity >= ALPHA_MIN && all(first <= last));
}

fn covers_a_pixel(view: View, e: Ellipse) -> bool {
  return covered_box(view, e).x > 0.0;
}

// Fraction of the image that a rasterizer visits for an ellipse with this box, in SHARE_UNITs: the quad around the
// ellipse, clipped to the box.
fn covered_share(view: View, e: Ellipse, box: vec2f) -> u32 {
  let diameter = 2.0 * cutoff_radius(e.opacity);
  let quad = (diameter * e.sigma_x) * (diameter * e.sigma_v);
  let pixels = min(box.x * box.y, max(quad, 1.0));
  return u32(f32(SHARE_UNIT) * pixels / (view.viewport.x * view.viewport.y));
}
