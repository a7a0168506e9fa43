// Propagates derivatives from the screen ellipses of the splats to their parameters by the chain rule: through EWA
// splatting (shared/projection) and the harmonics. The change of color as a splat moves is neglected.
#import shared/projection
#import shared/sh
#import shared/group
#import shared/refined

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> refine_view: RefineView;
@group(0) @binding(2) var<storage, read> numbers: array<f32>;
// The degree that each splat keeps.
@group(0) @binding(3) var<storage, read> degrees: array<u32>;
// SCREEN_NUMBERS of each splat, in fixed point; cleared afterwards for the next view.
@group(0) @binding(4) var<storage, read_write> screen: array<vec2i>;
@group(0) @binding(5) var<storage, read_write> gradients: array<f32>;
// The largest curvatures of each splat in any view: see BEND_COLOR.
@group(0) @binding(6) var<storage, read_write> bends: array<vec4f>;

// A splat with an eye within this many of its sizes is not moved. Derivatives do not include the cost of a step there:
// the near plane may clip the whole splat at once, and its depth order may change.
const NEAR_SIZES = 64.0;
const NO_MOVE = 1e30;
const FOUR_PI = 12.566371;

fn add(i: u32, step: u32, value: f32) {
  gradients[step * refine_view.row + i] += refine_view.weight * value;
}

fn row_of(i: u32) -> u32 {
  return i * (SH_AT + 3u * (view.sh_degree + 1u) * (view.sh_degree + 1u));
}

fn chain_color(i: u32, position: vec3f, by_color: vec3f) {
  let first = row_of(i) + SH_AT;
  let degree = degrees[i];
  let count = (degree + 1u) * (degree + 1u);
  let direction = normalize(position - view.eye);
  var color = vec3f(0.5);
  for (var quartet = 0u; 4u * quartet < count; quartet++) {
    let basis = sh_basis(quartet, direction);
    for (var k = 4u * quartet; k < min(count, 4u * quartet + 4u); k++) {
      let at = first + 3u * k;
      color += basis[k % 4u] * vec3f(numbers[at], numbers[at + 1u], numbers[at + 2u]);
    }
  }
  // Negative colors are clamped to black, so their derivative is 0.
  let used = select(vec3f(0.0), by_color, color > vec3f(0.0));
  for (var quartet = 0u; 4u * quartet < count; quartet++) {
    let basis = sh_basis(quartet, direction);
    for (var k = 4u * quartet; k < min(count, 4u * quartet + 4u); k++) {
      for (var channel = 0u; channel < 3u; channel++) { add(i, SH_STEP + 3u * k + channel, basis[k % 4u] * used[channel]); }
    }
  }
}

@compute @workgroup_size(REFINE_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * REFINE_GROUP + lane;
  if (i >= view.splat_count) { return; }
  let n = row_of(i);
  let position = vec3f(numbers[n], numbers[n + 1u], numbers[n + 2u]);
  let s = n + SCALE_AT;
  let r = n + ROTATION_AT;
  let own = turned(vec4f(numbers[r], numbers[r + 1u], numbers[r + 2u], numbers[r + 3u]), vec3f(numbers[s], numbers[s + 1u], numbers[s + 2u]));
  var p = in_camera(view, position);
  let reach = NEAR_SIZES * max(own.scales.x, max(own.scales.y, own.scales.z));
  if (dot(p, p) < reach * reach) { bends[i][BEND_POSITION] = NO_MOVE; }
  var seen: array<f32, SCREEN_NUMBERS>;
  var is_seen = false;
  for (var k = 0u; k < SCREEN_NUMBERS; k++) {
    let at = SCREEN_NUMBERS * i + k;
    seen[k] = of_fixed(screen[at]);
    is_seen = is_seen || seen[k] != 0.0;
    screen[at] = vec2i(0);
  }
  if (!is_seen) { return; }
  chain_color(i, position, vec3f(seen[0], seen[1], seen[2]));

  let to_camera = mat3x3f(view.local_to_camera[0].xyz, view.local_to_camera[1].xyz, view.local_to_camera[2].xyz);
  p.z = max(p.z, view.near);
  let xy = p.xy / p.z;
  let t = clamp(xy, view.jacobian_min, view.jacobian_max);
  // Columns are the axes of the splat in camera space; `a` has the rows.
  let axes = mat3x3f(to_camera * own.axes[0] * own.scales.x, to_camera * own.axes[1] * own.scales.y, to_camera * own.axes[2] * own.scales.z);
  let a = transpose(axes);
  let focal = view.focal / p.z;
  let row_x = (a[0] - t.x * a[2]) * focal.x;
  let row_y = (a[1] - t.y * a[2]) * focal.y;

  // The covariance on the screen is B Bᵀ; here B⁻¹ = (x, 0; lean, y).
  let bare = vec3f(dot(row_x, row_x), dot(row_x, row_y), dot(row_y, row_y));
  let variance_x = bare.x + view.filter_variance;
  let minors = cross(row_x, row_y);
  let bare_determinant = dot(minors, minors);
  let determinant = bare_determinant + view.filter_variance * (variance_x + bare.z);
  let x = inverseSqrt(variance_x);
  let y = sqrt(variance_x / determinant);
  let lean = -bare.y / variance_x * y;
  let by_center = vec2f(x * seen[4] + lean * seen[5], y * seen[5]);
  // B⁻ᵀ M B⁻¹ / 2 with the moments M: by xx, by xy (twice in the sum) and by yy.
  let m_x = x * seen[6] + lean * seen[7];
  let m_y = x * seen[7] + lean * seen[8];
  var by_covariance = 0.5 * vec3f(x * m_x + lean * m_y, y * m_y, y * y * seen[8]);
  if (view.antialiased != 0u && bare_determinant > COMPENSATION_MIN * COMPENSATION_MIN * determinant) {
    // The compensated opacity grows with the square root of the ratio of the determinants.
    by_covariance += 0.5 * seen[3] * (vec3f(bare.z, -bare.y, bare.x) / bare_determinant
      - vec3f(bare.z + view.filter_variance, -bare.y, variance_x) / determinant);
  }
  let by_row_x = 2.0 * (by_covariance.x * row_x + by_covariance.y * row_y);
  let by_row_y = 2.0 * (by_covariance.y * row_x + by_covariance.z * row_y);

  let by_a0 = focal.x * by_row_x;
  let by_a1 = focal.y * by_row_y;
  let by_a2 = -t.x * by_a0 - t.y * by_a1;
  let is_free = (xy > view.jacobian_min) & (xy < view.jacobian_max);
  let by_xy = by_center * view.focal - select(vec2f(0.0), vec2f(dot(a[2], by_a0), dot(a[2], by_a1)), is_free);
  let by_z = -(dot(row_x, by_row_x) + dot(row_y, by_row_y) + dot(by_xy, xy)) / p.z;
  let by_position = transpose(to_camera) * vec3f(by_xy / p.z, by_z);
  let stride = strides(own.scales);
  // Transposes rows to columns: by each axis of the splat, in the scene.
  let by_axes = transpose(mat3x3f(by_a0, by_a1, by_a2));
  var turns: array<vec3f, 3>;
  var max_shift = 0.0;
  for (var k = 0u; k < 3u; k++) {
    let shift = to_camera * own.axes[k] * stride[k] / p.z;
    let on_screen = (shift.xy - xy * shift.z) * view.focal;
    let in_ellipse = vec2f(x * on_screen.x, lean * on_screen.x + y * on_screen.y);
    // Bound by Cauchy-Schwarz: the derivative by u is u times the one by the logarithm of alpha, the one by a size u².
    max_shift = max(max_shift, dot(in_ellipse, in_ellipse) * sqrt(seen[10] * seen[11]) + shift.z * shift.z * seen[11]);
    add(i, k, stride[k] * dot(own.axes[k], by_position));
    add(i, GROWTH_STEP + k, dot(axes[k], by_axes[k]));
    turns[k] = own.scales[k] * (transpose(own.axes) * (transpose(to_camera) * by_axes[k]));
  }
  let swing = swings(stride);
  add(i, TURN_STEP, swing.x * (turns[1].z - turns[2].y));
  add(i, TURN_STEP + 1u, swing.y * (turns[2].x - turns[0].z));
  add(i, TURN_STEP + 2u, swing.z * (turns[0].y - turns[1].x));
  let opacity = 1.0 / (1.0 + exp(-numbers[n + LOGIT_AT]));
  add(i, LOGIT_STEP, seen[3] * (1.0 - opacity));
  let bases = f32((degrees[i] + 1u) * (degrees[i] + 1u)) / FOUR_PI;
  let bend = vec4f(bases * seen[9], (1.0 - opacity) * (1.0 - opacity) * seen[10], seen[11], max_shift);
  bends[i] = max(bends[i], 2.0 * refine_view.weight / BEND_UNIT * bend);
}
