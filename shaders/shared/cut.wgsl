// Finds the fraction of a splat inside the shape of a cut: that of a Gaussian between parallel planes, with the surface
// of the shape approximated by its tangent plane.
#import shared/gaussian
#import shared/modifiers

// Cumulative distribution function of the normal distribution (Abramowitz and Stegun 7.1.26), to 1e-7.
fn normal_below(x: f32) -> f32 {
  let z = min(abs(x) * 0.70710678, 8.0);
  let t = 1.0 / (1.0 + 0.3275911 * z);
  let tail = 0.5 * t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429)))) * exp(-z * z);
  return select(1.0 - tail, tail, x < 0.0);
}

// Fraction of a splat with a coordinate of the shape between two values; `gradient` is that of the coordinate.
fn share_between(g: Gaussian, coordinate: f32, gradient: vec3f, low: f32, high: f32, edge: f32) -> f32 {
  if (edge < 0.0) { return select(0.0, 1.0, coordinate >= low && coordinate <= high); }
  let spread = vec3f(dot(g.factor_x, gradient), dot(g.factor_y, gradient.yz), g.factor_z * gradient.z);
  let deviation = max(sqrt(dot(spread, spread) + edge * edge * dot(gradient, gradient)), 1e-9);
  return normal_below((high - coordinate) / deviation) - normal_below((low - coordinate) / deviation);
}

fn share_in_shape(cut: ModifierCut, g: Gaussian) -> f32 {
  let p = vec4f(g.position, 1.0);
  let at = vec3f(dot(cut.to_shape_x, p), dot(cut.to_shape_y, p), dot(cut.to_shape_z, p));
  let across = share_between(g, at.y, cut.to_shape_y.xyz, select(-0.5, -1e9, cut.shape == CUT_PLANE), select(0.5, 0.0, cut.shape == CUT_PLANE), cut.edge);
  switch cut.shape {
    case CUT_PLANE: { return across; }
    case CUT_BOX: {
      return across * share_between(g, at.x, cut.to_shape_x.xyz, -0.5, 0.5, cut.edge)
        * share_between(g, at.z, cut.to_shape_z.xyz, -0.5, 0.5, cut.edge);
    }
    default: {
      let is_sphere = cut.shape == CUT_SPHERE;
      let from_axis = vec3f(at.x, select(0.0, at.y, is_sphere), at.z);
      let radius = length(from_axis);
      let outward = from_axis / max(radius, 1e-9);
      let gradient = outward.x * cut.to_shape_x.xyz + outward.y * cut.to_shape_y.xyz + outward.z * cut.to_shape_z.xyz;
      let around = share_between(g, radius, gradient, -0.5, 0.5, cut.edge);
      return select(around * across, around, is_sphere);
    }
  }
}

// Fraction of a splat that a cut changes.
fn share_cut(cut: ModifierCut, g: Gaussian) -> f32 {
  let inside = share_in_shape(cut, g);
  return select(inside, 1.0 - inside, cut.is_outside != 0u);
}
