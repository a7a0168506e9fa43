// Finds the fraction of a splat inside the shape of a cut: that of a Gaussian between parallel planes, with the surface
// of the shape approximated by its tangent plane.
#import shared/gaussian
#import shared/modifiers

// Less of the variance of a splat than this is never kept.
const MIN_VARIANCE = 0.01;
// Less of a splat than this is not seen.
const MIN_MASS = 0.004;

// Cumulative distribution function of the normal distribution (Abramowitz and Stegun 7.1.26), to 1e-7.
fn normal_below(x: f32) -> f32 {
  // Most splats are far from the surface.
  if (abs(x) > 6.0) { return select(1.0, 0.0, x < 0.0); }
  let z = abs(x) * 0.70710678;
  let t = 1.0 / (1.0 + 0.3275911 * z);
  let tail = 0.5 * t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429)))) * exp(-z * z);
  return select(1.0 - tail, tail, x < 0.0);
}

// Density of the normal distribution.
fn normal_density(x: f32) -> f32 {
  return 0.39894228 * exp(-0.5 * x * x);
}

// Limits of a shape along one of its coordinates: the coordinate of the center of a splat, its gradient, and the limits.
struct CutSlab {
  at: f32,
  gradient: vec3f,
  low: f32,
  high: f32,
}

fn slab_count(shape: u32) -> u32 {
  if (shape == CUT_EVERYWHERE) { return 0u; }
  return select(select(1u, 2u, shape == CUT_CYLINDER), 3u, shape == CUT_BOX);
}

fn slab_of(c: u32, position: vec3f, k: u32) -> CutSlab {
  let shape = modifiers.cuts[c].shape;
  let to_x = modifiers.cuts[c].to_shape_x;
  let to_y = modifiers.cuts[c].to_shape_y;
  let to_z = modifiers.cuts[c].to_shape_z;
  let p = vec4f(position, 1.0);
  let y = dot(to_y, p);
  if (shape == CUT_PLANE) { return CutSlab(y, to_y.xyz, -1e9, 0.0); }
  if (k == 1u) { return CutSlab(y, to_y.xyz, -0.5, 0.5); }
  let x = dot(to_x, p);
  let z = dot(to_z, p);
  if (shape == CUT_BOX) {
    if (k == 0u) { return CutSlab(x, to_x.xyz, -0.5, 0.5); }
    return CutSlab(z, to_z.xyz, -0.5, 0.5);
  }
  let from_axis = vec3f(x, select(0.0, y, shape == CUT_SPHERE), z);
  let radius = length(from_axis);
  let outward = from_axis / max(radius, 1e-9);
  return CutSlab(radius, outward.x * to_x.xyz + outward.y * to_y.xyz + outward.z * to_z.xyz, -0.5, 0.5);
}

// Root of the covariance, transposed, times a gradient: its length is the standard deviation of the coordinate.
fn spread_along(g: Gaussian, gradient: vec3f) -> vec3f {
  return vec3f(dot(g.factor_x, gradient), dot(g.factor_y, gradient.yz), g.factor_z * gradient.z);
}

// Limits in standard deviations of the coordinate and of the edge, and the fraction of both that is that of the splat.
fn limits_of(slab: CutSlab, spread: vec3f, edge: f32) -> vec3f {
  let own = dot(spread, spread);
  let deviation = max(sqrt(own + edge * edge * dot(slab.gradient, slab.gradient)), 1e-9);
  let limits = clamp(vec2f(slab.low - slab.at, slab.high - slab.at) / deviation, vec2f(-8.0), vec2f(8.0));
  return vec3f(limits, sqrt(own) / deviation);
}

fn share_in_shape(c: u32, g: Gaussian) -> f32 {
  let edge = modifiers.cuts[c].edge;
  var share = 1.0;
  for (var k = 0u; k < slab_count(modifiers.cuts[c].shape); k++) {
    let slab = slab_of(c, g.position, k);
    if (edge < 0.0) {
      share *= select(0.0, 1.0, slab.at >= slab.low && slab.at <= slab.high);
    } else {
      let limits = limits_of(slab, spread_along(g, slab.gradient), edge);
      share *= normal_below(limits.y) - normal_below(limits.x);
    }
  }
  return share;
}

// Scales the variance of a splat along a gradient: a rank-one downdate of the root, column by column.
fn narrow_gaussian(g: ptr<function, Gaussian>, gradient: vec3f, kept: f32) {
  let spread = spread_along(*g, gradient);
  let size = length(spread);
  if (size <= 0.0) { return; }
  let u = spread / size;
  var x = sqrt(1.0 - kept) * (u.x * (*g).factor_x + vec3f(0.0, u.y * (*g).factor_y) + vec3f(0.0, 0.0, u.z * (*g).factor_z));
  let sine_x = clamp(x.x / max((*g).factor_x.x, 1e-30), -1.0, 1.0);
  let cosine_x = sqrt(max(1.0 - sine_x * sine_x, 1e-4));
  let column_x = ((*g).factor_x.yz - sine_x * x.yz) / cosine_x;
  x = vec3f(x.x, cosine_x * x.yz - sine_x * column_x);
  (*g).factor_x = vec3f(cosine_x * (*g).factor_x.x, column_x);
  let sine_y = clamp(x.y / max((*g).factor_y.x, 1e-30), -1.0, 1.0);
  let cosine_y = sqrt(max(1.0 - sine_y * sine_y, 1e-4));
  let column_y = ((*g).factor_y.y - sine_y * x.z) / cosine_y;
  x.z = cosine_y * x.z - sine_y * column_y;
  (*g).factor_y = vec2f(cosine_y * (*g).factor_y.x, column_y);
  let sine_z = clamp(x.z / max((*g).factor_z, 1e-30), -1.0, 1.0);
  (*g).factor_z *= sqrt(max(1.0 - sine_z * sine_z, 1e-4));
}

// Hides a part of a splat: its rest becomes the Gaussian of the same mass, mean and variance, along each coordinate of
// the shape. `found` is the splat before all cuts, and `inside` its fraction in the shape.
fn trim_gaussian(g: ptr<function, Gaussian>, found: Gaussian, c: u32, inside: f32) {
  let opacity = modifiers.cuts[c].opacity;
  let is_outside = modifiers.cuts[c].is_outside != 0u;
  let mass = 1.0 - (1.0 - opacity) * select(inside, 1.0 - inside, is_outside);
  var narrowed = 1.0;
  for (var k = 0u; k < slab_count(modifiers.cuts[c].shape); k++) {
    let slab = slab_of(c, found.position, k);
    let spread = spread_along(found, slab.gradient);
    let limits = limits_of(slab, spread, modifiers.cuts[c].edge);
    let share = normal_below(limits.y) - normal_below(limits.x);
    // Remaining opacity of a point: `base`, and within the limits `weight` more.
    let base = select(1.0, opacity, is_outside);
    let weight = select(-1.0, 1.0, is_outside) * (1.0 - opacity) * min(inside / max(share, 1e-6), 1.0);
    let low = normal_density(limits.x);
    let high = normal_density(limits.y);
    let mean = weight * limits.z * (low - high) / mass;
    let second = (base + weight * (share + limits.z * limits.z * (limits.x * low - limits.y * high))) / mass;
    let kept = clamp(second - mean * mean, MIN_VARIANCE, 1.0);
    let u = mean * spread / max(length(spread), 1e-30);
    (*g).position += u.x * found.factor_x + vec3f(0.0, u.y * found.factor_y) + vec3f(0.0, 0.0, u.z * found.factor_z);
    narrow_gaussian(g, slab.gradient, kept);
    narrowed *= sqrt(kept);
  }
  (*g).opacity *= min(mass / narrowed, 1.0);
}
