// Memory layout of the parameters of a splat during refinement.

// For each splat in order: x, y, z; logarithms of the three scales; w, x, y, z of the rotation; logit of the opacity;
// harmonics in the order [coefficient][channel].
const SCALE_AT = 3u;
const ROTATION_AT = 6u;
const LOGIT_AT = 10u;
const SH_AT = 11u;

// The optimized parameters, one row of all splats each: steps along the splat's own axes in units of its sizes; log
// scales; rotations about its own axes in radians; logit; harmonics.
const GROWTH_STEP = 3u;
const TURN_STEP = 6u;
const LOGIT_STEP = 9u;
const SH_STEP = 10u;

// Sums over the pixels of an image for each splat: derivatives by its color, and the sums of q, q·u, q·v, q·u², q·u·v
// and q·v², with q the derivative by the logarithm of alpha and (u, v) the position of the pixel in the ellipse. Then
// curvatures of the squared error times BEND_UNIT: squared derivatives of the pixel by the color and by the logarithm
// of alpha, and the latter times (u² + v²)².
const SCREEN_NUMBERS = 12u;
const BEND_UNIT = 0.125;
// Bytes of each number: two words of a sum in fixed point.
const SCREEN_BYTES = 8u;
// Steps of the fixed point in 1.
const FIXED = 16777216.0;

// Converts a sum of integers whose lower halves are added in x (u32) and upper halves in y: one word would overflow
// over many tiles.
fn of_fixed(words: vec2i) -> f32 {
  let low = bitcast<u32>(words.x);
  return (f32(words.y + i32(low >> 16u)) * 65536.0 + f32(low & 0xffffu)) / FIXED;
}

// Gauss-Newton curvatures of the squared error of a view, which neglect second derivatives of the image: by all
// harmonics of a channel at once, by the logit, and upper bounds of those by any scale or rotation, and by any step
// along an axis.
const BEND_COLOR = 0u;
const BEND_LOGIT = 1u;
const BEND_SHAPE = 2u;
const BEND_POSITION = 3u;

const REFINE_GROUP = 64u;

// A view in the coordinates of a block, and the weight of its error.
struct RefineView {
  // Stride between rows.
  row: u32,
  weight: f32,
}

// Minimum length of an axis along which a splat moves, relative to its longest axis.
const MIN_AXIS = 0.02;

struct Turned {
  // Columns of the rotation.
  axes: mat3x3f,
  scales: vec3f,
}

// Converts a quaternion in the order w, x, y, z, of any length, and log scales.
fn turned(q: vec4f, logarithms: vec3f) -> Turned {
  let n = normalize(q);
  let w = n.x; let x = n.y; let y = n.z; let z = n.w;
  let axes = mat3x3f(
    vec3f(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
    vec3f(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
    vec3f(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
  );
  return Turned(axes, exp(logarithms));
}

// Distance that a step of 1 moves a splat along each of its axes.
fn strides(scales: vec3f) -> vec3f {
  return max(scales, vec3f(MIN_AXIS * max(scales.x, max(scales.y, scales.z))));
}

// Angle of a step of 1 about each axis: smaller for elongated splats, so that their ends do not move farther than they
// are wide.
fn swings(stride: vec3f) -> vec3f {
  let a = stride.yzx;
  let b = stride.zxy;
  return min(a, b) / max(a, b);
}
