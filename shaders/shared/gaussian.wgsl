// A Gaussian as the stages reckon with it, in page-local coordinates. How it lies in memory: shared/packed_gaussian, shared/quantized_gaussian.
struct Gaussian {
  position: vec3f,
  opacity: f32,
  // Columns of the lower triangular root L of the covariance, Σ = L Lᵀ: xx, yx, zx; yy, zy; zz.
  factor_x: vec3f,
  factor_y: vec2f,
  factor_z: f32,
}
