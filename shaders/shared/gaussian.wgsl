// A Gaussian as it lies in memory: three words of 16 bytes. Loaded as integers, because only integer bits can tell a
// NaN or an infinity: WGSL lets compilers assume that floating-point maths never meets one.
struct PackedGaussian {
  // x, y, z (float32, page-local), opacity (float32, linear)
  position_opacity: vec4u,
  // quaternion w, x, y, z (float32, local axes to world)
  rotation: vec4u,
  // standard deviations along the local axes (float32, linear), unused
  scale: vec4u,
}

struct Gaussian {
  position: vec3f,
  opacity: f32,
  // w, x, y, z
  rotation: vec4f,
  scale: vec3f,
}

const EXPONENT_BITS = vec4u(0x7f800000u);
// Longest standard deviation of a splat that can be drawn: MIN_LONGEST_SCALE and MAX_SCALE of core.
const MIN_LONGEST_SCALE = 1e-12;
const MAX_SCALE = 1e12;

fn unpack_gaussian(g: PackedGaussian) -> Gaussian {
  return Gaussian(
    bitcast<vec3f>(g.position_opacity.xyz),
    bitcast<f32>(g.position_opacity.w),
    bitcast<vec4f>(g.rotation),
    bitcast<vec3f>(g.scale.xyz),
  );
}

// Four float32 with an exponent other than that of NaN and infinity.
fn has_finite_bits(words: vec4u) -> bool {
  let exponents = words & EXPONENT_BITS;
  return all(exponents != EXPONENT_BITS);
}

// True if every attribute is finite, the rotation is not zero and the scale is drawable (isUsable in core).
fn is_usable(g: PackedGaussian) -> bool {
  let finite = has_finite_bits(g.position_opacity) && has_finite_bits(g.rotation)
    && has_finite_bits(vec4u(g.scale.xyz, 0u));
  let scale = bitcast<vec3f>(g.scale.xyz);
  let longest = max(scale.x, max(scale.y, scale.z));
  let rotation = abs(bitcast<vec4f>(g.rotation));
  let rotates = max(max(rotation.x, rotation.y), max(rotation.z, rotation.w)) > 0.0;
  return finite && rotates && all(scale >= vec3f(0.0)) && longest >= MIN_LONGEST_SCALE && longest <= MAX_SCALE;
}

// Rotation matrix of a quaternion (w, x, y, z) that is brought to unit length here.
fn rotation_matrix(q_any: vec4f) -> mat3x3f {
  let largest = max(max(abs(q_any.x), abs(q_any.y)), max(abs(q_any.z), abs(q_any.w)));
  let q = normalize(q_any / largest);
  let w = q.x; let x = q.y; let y = q.z; let z = q.w;
  return mat3x3f(
    1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
    2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
    2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y),
  );
}
