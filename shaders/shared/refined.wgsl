// How the numbers of a splat that is fitted to pictures lie in memory.

// For each splat one after another: x, y, z; logarithms of the three scales; w, x, y, z of the rotation; the logit of the opacity; harmonics in
// the order [coefficient][channel].
const SCALE_AT = 3u;
const ROTATION_AT = 6u;
const LOGIT_AT = 10u;
const SH_AT = 11u;

// What is sought: steps along the splat's own axes, in its own sizes; of the logarithms; turns about its own axes, radians; of the logit; of the
// harmonics. A row of all splats for each of these.
const GROWTH_STEP = 3u;
const TURN_STEP = 6u;
const LOGIT_STEP = 9u;
const SH_STEP = 10u;

// What a picture's pixels tell of a splat: by its colour, and the sums of q, q·u, q·v, q·u², q·u·v and q·v², where q is the derivative by the
// logarithm of alpha and u, v are where the pixel lies in the ellipse. Then how much the squared error bends, times BEND_UNIT: the squares of what the
// pixel changes by with the colour and with the logarithm of alpha, and the latter times (u² + v²)².
const SCREEN_NUMBERS = 12u;
const BEND_UNIT = 0.125;
// Bytes of each: two words of a sum in fixed point.
const SCREEN_BYTES = 8u;
// Steps of the fixed point in 1.
const FIXED = 16777216.0;

// A sum of integers whose lower halves are added up in x, an u32, and whose upper halves in y: a single word would not hold what many tiles add.
fn of_fixed(words: vec2i) -> f32 {
  let low = bitcast<u32>(words.x);
  return (f32(words.y + i32(low >> 16u)) * 65536.0 + f32(low & 0xffffu)) / FIXED;
}

// Curvatures of a view's squared error (Gauss and Newton's: without how the picture itself bends): by all harmonics of a channel at once, by the logit, and
// bounds of those by any scale or turn, and by any step along an axis.
const BEND_COLOUR = 0u;
const BEND_LOGIT = 1u;
const BEND_SHAPE = 2u;
const BEND_POSITION = 3u;

const REFINE_GROUP = 64u;

// A view, as the splats of a page meet it; and how much of an error it counts for.
struct RefineView {
  // From one row to the next.
  row: u32,
  weight: f32,
}

// Least length of an axis along which a splat moves, in those of its longest one.
const LEAST_AXIS = 0.02;

struct Turned {
  // Columns of the rotation.
  axes: mat3x3f,
  scales: vec3f,
}

// Of a quaternion in the order w, x, y, z, which need not be of length 1, and logarithms.
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

// How far a step of 1 moves a splat along each of its axes.
fn strides(scales: vec3f) -> vec3f {
  return max(scales, vec3f(LEAST_AXIS * max(scales.x, max(scales.y, scales.z))));
}

// How far a step of 1 turns it about each of them: long and thin ones less, so that their ends do not go farther than they are wide.
fn swings(stride: vec3f) -> vec3f {
  let a = stride.yzx;
  let b = stride.zxy;
  return min(a, b) / max(a, b);
}
