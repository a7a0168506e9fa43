// Updates the parameters of each splat by their derivatives: Adam (Kingma and Ba 2015). Clears the derivatives for the
// next views.
#import shared/group
#import shared/refined

struct RefineStep {
  splat_count: u32,
  // Stride between rows.
  row: u32,
  // Harmonics of a splat in memory, over all channels.
  harmonics: u32,
  // Decay factors of the running means of derivatives and of their squares, and the bias corrections of the first
  // steps.
  keep_mean: f32,
  keep_square: f32,
  mean_scale: f32,
  square_scale: f32,
  // Epsilon: derivatives far below it change little.
  epsilon: f32,
  // Limit of a step as a fraction of Newton's step along one parameter, computed with the largest curvature in any
  // view.
  newton: f32,
  // Learning rates.
  position_rate: f32,
  growth_rate: f32,
  turn_rate: f32,
  logit_rate: f32,
  constant_rate: f32,
  harmonic_rate: f32,
}

@group(0) @binding(0) var<uniform> step: RefineStep;
@group(0) @binding(1) var<storage, read_write> numbers: array<f32>;
// The degree that each splat keeps.
@group(0) @binding(2) var<storage, read> degrees: array<u32>;
@group(0) @binding(3) var<storage, read_write> gradients: array<f32>;
// Running means of the derivatives, and of their squares.
@group(0) @binding(4) var<storage, read_write> means: array<vec2f>;
// The largest curvatures of each splat in any view: see BEND_COLOR.
@group(0) @binding(5) var<storage, read> bends: array<vec4f>;

const MIN_BEND = 1e-30;

// Length of the step along one parameter.
fn stride_along(i: u32, number: u32, rate: f32, bend: u32) -> f32 {
  let at = number * step.row + i;
  let g = gradients[at];
  gradients[at] = 0.0;
  let old = means[at];
  let mean = mix(vec2f(g, g * g), old, vec2f(step.keep_mean, step.keep_square));
  means[at] = mean;
  let step_rate = min(rate / (sqrt(mean.y * step.square_scale) + step.epsilon), step.newton / max(MIN_BEND, bends[i][bend]));
  return -mean.x * step.mean_scale * step_rate;
}

fn vector_along(i: u32, number: u32, rate: f32, bend: u32) -> vec3f {
  return vec3f(
    stride_along(i, number, rate, bend),
    stride_along(i, number + 1u, rate, bend),
    stride_along(i, number + 2u, rate, bend),
  );
}

@compute @workgroup_size(REFINE_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * REFINE_GROUP + lane;
  if (i >= step.splat_count) { return; }
  let n = i * (SH_AT + step.harmonics);
  let s = n + SCALE_AT;
  let r = n + ROTATION_AT;
  let q = vec4f(numbers[r], numbers[r + 1u], numbers[r + 2u], numbers[r + 3u]);
  let own = turned(q, vec3f(numbers[s], numbers[s + 1u], numbers[s + 2u]));
  let stride = strides(own.scales);
  let shift = own.axes * (stride * vector_along(i, 0u, step.position_rate, BEND_POSITION));
  let growth = vector_along(i, GROWTH_STEP, step.growth_rate, BEND_SHAPE);
  // A rotation by a small angle about the splat's own axes: q (1, turn / 2).
  let h = 0.5 * swings(stride) * vector_along(i, TURN_STEP, step.turn_rate, BEND_SHAPE);
  let v = q.yzw;
  let turned_q = normalize(vec4f(q.x - dot(v, h), v + q.x * h + cross(v, h)));
  for (var k = 0u; k < 3u; k++) {
    numbers[n + k] += shift[k];
    numbers[s + k] += growth[k];
  }
  for (var k = 0u; k < 4u; k++) { numbers[r + k] = turned_q[k]; }
  numbers[n + LOGIT_AT] += stride_along(i, LOGIT_STEP, step.logit_rate, BEND_LOGIT);
  let degree = degrees[i];
  let kept = 3u * (degree + 1u) * (degree + 1u);
  for (var k = 0u; k < kept; k++) {
    let rate = select(step.harmonic_rate, step.constant_rate, k < 3u);
    numbers[n + SH_AT + k] += stride_along(i, SH_STEP + k, rate, BEND_COLOR);
  }
}
