// A Gaussian for computation, in block-local coordinates. Storage layouts: shared/packed_gaussian,
// shared/quantized_gaussian.
struct Gaussian {
  position: vec3f,
  opacity: f32,
  // Columns of the lower triangular root L of the covariance, Σ = L Lᵀ: xx, yx, zx; yy, zy; zz.
  factor_x: vec3f,
  factor_y: vec2f,
  factor_z: f32,
}
