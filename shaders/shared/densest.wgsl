// The densest depth of a Gaussian along the ray of a pixel.
#import shared/projection
#import shared/pixel_depth

struct DensestDepth {
  depth: PixelDepth,
  // Depth of the center, and the standard deviation of the densest depth over the screen, in world units.
  center: f32,
  spread: f32,
  // Standard deviation of the Gaussian along the camera's axis, and along a ray.
  sigma: f32,
  thickness: f32,
}

// `filter_variance` in px² widens the Gaussian on the screen: pass that of the view for the splat as drawn.
fn pixel_depth_of(view: View, g: Gaussian, filter_variance: f32) -> DensestDepth {
  var p = in_camera(view, g.position);
  p.z = max(p.z, view.near);
  let is_parallel = view.is_orthographic != 0u;
  let shrink = select(p.z, 1.0, is_parallel);
  let t = select(p.xy / p.z, vec2f(0.0), is_parallel);
  let to_camera = mat3x3f(view.local_to_camera[0].xyz, view.local_to_camera[1].xyz, view.local_to_camera[2].xyz);
  let axes = mat3x3f(
    to_camera * g.factor_x,
    to_camera[1] * g.factor_y.x + to_camera[2] * g.factor_y.y,
    to_camera[2] * g.factor_z,
  );
  // Pixels across and down of the axes of the splat, seen along the ray through its center, and their depths.
  let a = transpose(axes);
  let row_x = (a[0] - t.x * a[2]) * (view.focal.x / shrink);
  let row_y = (a[1] - t.y * a[2]) * (view.focal.y / shrink);
  let row_z = a[2];

  // Regression of depth on x, and on the residual of y: the same factorization as the ellipse (shared/ellipse), so that
  // needles keep their digits.
  let variance_x = dot(row_x, row_x) + filter_variance;
  let by_x = dot(row_z, row_x) / variance_x;
  let lean = dot(row_x, row_y) / variance_x;
  let minors = cross(row_x * inverseSqrt(variance_x), row_y);
  let variance_v = dot(minors, minors) + filter_variance * (variance_x + dot(row_y, row_y)) / variance_x;
  let by_v = dot(row_z, row_y - lean * row_x) / max(variance_v, 1e-30);
  let by_pixel = vec2f(by_x - by_v * lean, by_v);
  let spread = by_x * by_x * variance_x + by_v * by_v * variance_v;
  let along_ray = max(dot(row_z, row_z) - spread, 0.0);

  var depth = PixelDepth(by_pixel, p.z, 0.0);
  if (!is_parallel) { depth = PixelDepth(-by_pixel / (p.z * p.z), 1.0 / p.z, along_ray / (p.z * p.z)); }
  return DensestDepth(depth, p.z, sqrt(spread), length(row_z), sqrt(along_ray));
}

// Minimum screen variance of a Gaussian in px², so that a disc seen edge-on has a densest point, too.
const SURFACE_VARIANCE = 1e-3;

struct SurfaceDepth {
  // World units along the optical axis, and the standard deviation along it.
  depth: f32,
  thickness: f32,
}

// Densest depth of the unfiltered Gaussian along the ray of a pixel: at most 3 standard deviations from its center.
fn surface_at(view: View, g: Gaussian, pixel: vec2f) -> SurfaceDepth {
  let found = pixel_depth_of(view, g, SURFACE_VARIANCE);
  let e = project_ellipse(view, g);
  let offset = pixel - e.center;
  let linear = found.depth.nearness + dot(found.depth.slope, offset);
  let reach = 3.0 * found.sigma;
  var depth = linear;
  if (view.is_orthographic == 0u) {
    let u = offset.x / e.sigma_x;
    let v = (offset.y - e.slope * offset.x) / e.sigma_v;
    depth = select(max(1.0 - found.depth.bend * (u * u + v * v), 0.0) / max(linear, 1e-30), 0.0, linear <= 0.0);
  }
  return SurfaceDepth(clamp(depth, max(found.center - reach, view.near), found.center + reach), found.thickness);
}
