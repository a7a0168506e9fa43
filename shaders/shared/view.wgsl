// What the projection stages must know of the camera and of the page of Gaussians at hand.
struct View {
  // Page-local coordinates (relative to the cloud's float64 origin) to camera axes: x right, y down, z forward.
  local_to_camera: mat4x4f,
  // The camera's centre in page-local coordinates.
  eye: vec3f,
  splat_count: u32,
  // Focal lengths, principal point and image size in pixels.
  focal: vec2f,
  principal: vec2f,
  viewport: vec2f,
  // Limits of x/z and y/z in the Jacobian: 1.3 tan(fov/2) on either side, asymmetric for an off-centre principal point.
  jacobian_min: vec2f,
  jacobian_max: vec2f,
  // What float32 leaves of the eye's coordinates.
  eye_rest: vec3f,
  near: f32,
  far: f32,
  // Place of this page among the pages of the frame, and of its first cull group among all groups.
  page: u32,
  first_group: u32,
  sh_degree: u32,
  // Degree up to which coefficients are used, and how they are stored.
  sh_cap: u32,
  sh_encoding: u32,
  antialiased: u32,
  // Variance in px² that the low-pass filter adds to both screen axes.
  filter_variance: f32,
  // Bits of a depth key: 32 for those of the float32 depth itself, fewer for a share of the visible range; 33 for the distance from the eye in its place.
  key_bits: u32,
  // Most that the camera's matrix stretches a vector: 1 unless it is more than a rotation and a translation.
  stretch: f32,
  // 1 if the page has levels of detail.
  has_detail: u32,
  // Pixels that a chunk may be off on screen before the finer ones that it stands for take its place, and over how many octaves
  // below that they do (shared/detail).
  detail: f32,
  detail_fade: f32,
  // Splats that the frame may look at.
  splat_budget: u32,
  // Only splats whose centres lie between these, in page-local coordinates, are drawn.
  crop_low: vec3f,
  // Factor of the optical depth of each splat (shared/scene_opacity): 1 for none.
  opacity: f32,
  crop_high: vec3f,
  // 1 if all rays are parallel: focal lengths are then pixels for each world unit, and the Jacobian's limits 0.
  is_orthographic: u32,
  // Along which such rays go, in page-local coordinates.
  axis: vec3f,
  // How often the splats of a frame may cover it, in COVERED_UNITs.
  most_covered: u32,
}

// From page-local coordinates to the camera's axes. What lies near the eye is subtracted from it first, which is exact: far from the page's origin both are
// large numbers, and rounded when they are turned.
fn in_camera(view: View, position: vec3f) -> vec3f {
  let to_camera = mat3x3f(view.local_to_camera[0].xyz, view.local_to_camera[1].xyz, view.local_to_camera[2].xyz);
  return to_camera * ((position - view.eye) - view.eye_rest);
}
