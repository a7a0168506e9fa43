// Fits the coefficients of lower degrees of each splat to the colors that the views saw, by least squares, and finds
// the remaining error: ColorMoments does the same on the CPU. Also finishes the scores once all views are rendered.
#import shared/moments
#import shared/group
#import shared/score

struct Lowering {
  // Splats of the block, and the stride between rows of `moments`.
  splat_count: u32,
  row: u32,
  views: u32,
  sh_degree: u32,
  // Mean squared error of an image without a splat, per unit of the splat's energy in it.
  contrast: f32,
  // Number of imagined views, spread over all directions, that are added to the real ones.
  prior_views: f32,
  // Minimum of views that must contain a splat before it is scored.
  min_looks: u32,
}

@group(0) @binding(0) var<uniform> lowering: Lowering;
// float16, two in each word.
@group(0) @binding(1) var<storage, read> sh: array<u32>;
@group(0) @binding(2) var<storage, read> moments: array<f32>;
@group(0) @binding(3) var<storage, read_write> scores: array<Score>;
// For each splat the errors of degrees 0 to sh_degree - 1, then the coefficients of degree 0, of degree 1 and of degree
// 2.
@group(0) @binding(4) var<storage, read_write> lowered: array<f32>;

const PI = 3.14159265358979;
// Stands for "no bound", because WGSL has no infinity.
const UNJUDGED = 3e38;
// Directions that no view covers stay unchanged: their pivot is below this fraction of the diagonal.
const MIN_PIVOT = 1e-6;

var<private> own: array<vec3f, MAX_COEFFICIENTS>;
var<private> shift: array<vec3f, MAX_COEFFICIENTS>;

fn half_at(number: u32) -> f32 {
  let pair = unpack2x16float(sh[number / 2u]);
  return select(pair.x, pair.y, number % 2u == 1u);
}

fn load_coefficients(i: u32, size: u32) {
  let first = 4u * i * sh_stride(lowering.sh_degree, SH_FLOAT16);
  for (var k = 0u; k < size; k++) {
    let n = first + 3u * k;
    own[k] = vec3f(half_at(n), half_at(n + 1u), half_at(n + 2u));
  }
}

// Cholesky factorization of the moments, in place. One factor serves all degrees, because the factor of the first
// coefficients is its leading block.
fn factorize(size: u32) {
  for (var row = 0u; row < size; row++) {
    for (var column = 0u; column <= row; column++) {
      let place = at(row, column);
      let whole = matrix[place];
      var sum = whole;
      for (var k = 0u; k < column; k++) { sum -= matrix[at(row, k)] * matrix[at(column, k)]; }
      if (column < row) {
        let pivot = matrix[at(column, column)];
        matrix[place] = select(0.0, sum / max(pivot, 1e-37), pivot > 0.0);
      } else {
        matrix[place] = select(0.0, sqrt(max(sum, 0.0)), sum > MIN_PIVOT * whole);
      }
    }
  }
}

// Column `column` of the factor times the coefficients from `first` on.
fn projected(column: u32, first: u32, size: u32) -> vec3f {
  var sum = vec3f(0.0);
  for (var row = max(first, column); row < size; row++) { sum += matrix[at(row, column)] * own[row]; }
  return sum;
}

// Squared error, over all channels, that remains if the coefficients from `kept` on are dropped and the others
// compensate: their part in the last columns of the factor. A sum of squares, so nothing cancels.
fn squares_left(kept: u32, size: u32) -> f32 {
  var squares = 0.0;
  for (var column = kept; column < size; column++) {
    let p = projected(column, column, size);
    squares += dot(p, p);
  }
  return squares;
}

// Finds the best correction of the first coefficients if those from `kept` on are dropped.
fn find_shift(kept: u32, size: u32) {
  for (var step = 0u; step < kept; step++) {
    let row = kept - 1u - step;
    var right = projected(row, kept, size);
    for (var k = row + 1u; k < kept; k++) { right -= matrix[at(k, row)] * shift[k]; }
    let pivot = matrix[at(row, row)];
    shift[row] = select(vec3f(0.0), right / max(pivot, 1e-37), pivot > 0.0);
  }
}

// Color errors of a splat that too few views contain are unknown, so they stay unbounded.
fn lower(i: u32, degree: u32, size: u32, energy: f32, is_judged: bool) {
  let kept = (degree + 1u) * (degree + 1u);
  var error = select(UNJUDGED, 0.0, is_judged);
  for (var k = 0u; k < kept; k++) { shift[k] = vec3f(0.0); }
  if (energy > 0.0) {
    error = max(error, squares_left(kept, size) / (3.0 * f32(lowering.views)));
    find_shift(kept, size);
  }
  let record = i * lowered_numbers(lowering.sh_degree, lowering.sh_degree);
  lowered[record + degree] = error;
  let first = record + lowered_numbers(lowering.sh_degree, degree);
  for (var k = 0u; k < kept; k++) {
    let value = own[k] + shift[k];
    lowered[first + 3u * k] = value.x;
    lowered[first + 3u * k + 1u] = value.y;
    lowered[first + 3u * k + 2u] = value.z;
  }
}

@compute @workgroup_size(SCORE_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * SCORE_GROUP + lane;
  if (i >= lowering.splat_count) { return; }
  let s = scores[i];
  let is_judged = s.looks >= lowering.min_looks;
  scores[i].contribution = select(1.0, s.contribution, is_judged);
  scores[i].removal = select(UNJUDGED, lowering.contrast * s.removal, is_judged);
  if (lowering.sh_degree == 0u) { return; }
  let size = (lowering.sh_degree + 1u) * (lowering.sh_degree + 1u);
  load_coefficients(i, size);
  for (var k = 0u; k < at(size, 0u); k++) { matrix[k] = moments[k * lowering.row + i]; }
  let prior = lowering.prior_views * s.energy / f32(max(1u, s.looks)) / (4.0 * PI);
  for (var k = 0u; k < size; k++) { matrix[at(k, k)] += prior; }
  factorize(size);
  for (var degree = 0u; degree < lowering.sh_degree; degree++) { lower(i, degree, size, s.energy, is_judged); }
}
