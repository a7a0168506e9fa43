// Camera and current block of Gaussians for the projection stages.
struct View {
  // Block-local coordinates (relative to the cloud's float64 origin) to camera axes: x right, y down, z forward.
  local_to_camera: mat4x4f,
  // Camera center in block-local coordinates.
  eye: vec3f,
  splat_count: u32,
  // Focal lengths, principal point and image size in pixels.
  focal: vec2f,
  principal: vec2f,
  viewport: vec2f,
  // Limits of x/z and y/z in the Jacobian: 1.3 tan(fov/2) on either side, asymmetric for an off-center principal point.
  jacobian_min: vec2f,
  jacobian_max: vec2f,
  // Residual of the eye's coordinates after rounding to float32.
  eye_rest: vec3f,
  near: f32,
  far: f32,
  // Index of this block among the blocks of the frame, and of its first cull group among all groups.
  page: u32,
  first_group: u32,
  sh_degree: u32,
  // Maximum degree that is evaluated, and the storage of coefficients.
  sh_cap: u32,
  sh_encoding: u32,
  antialiased: u32,
  // Variance in px² that the low-pass filter adds to both screen axes.
  filter_variance: f32,
  // Bits of a depth key: 32 for the float32 depth itself, fewer for a fraction of the visible range; 33 for the
  // distance from the eye.
  key_bits: u32,
  // Upper bound of the factor by which the camera matrix stretches a vector: 1 for a rotation and a translation.
  stretch: f32,
  // 1 if the block has levels of detail.
  has_detail: u32,
  // Screen error in pixels above which a chunk is replaced by its children, and the octaves below it over which they
  // fade in (shared/lod).
  detail: f32,
  detail_fade: f32,
  // Maximum number of splats in the frame.
  splat_budget: u32,
  // Only splats whose centers lie in this box, in block-local coordinates, are drawn.
  crop_low: vec3f,
  // Factor of the optical depth of each splat (shared/scene_opacity); 1 changes nothing.
  opacity: f32,
  crop_high: vec3f,
  // 1 if all rays are parallel: focal lengths are then pixels per world unit, and the limits of the Jacobian are 0.
  is_orthographic: u32,
  // Direction of parallel rays, in block-local coordinates.
  axis: vec3f,
  // Maximum total coverage of the image by the splats of a frame, in COVERED_UNITs.
  max_covered: u32,
}

// Transforms block-local coordinates to camera axes. The eye is subtracted first, which is exact near it: far from the
// origin of the block both are large numbers and would be rounded by the rotation.
fn in_camera(view: View, position: vec3f) -> vec3f {
  let to_camera = mat3x3f(view.local_to_camera[0].xyz, view.local_to_camera[1].xyz, view.local_to_camera[2].xyz);
  return to_camera * ((position - view.eye) - view.eye_rest);
}
