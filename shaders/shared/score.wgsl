// What the views at hand have told of a splat. `economise` scores a scene with it, in parts of as many splats as a binding holds.
struct Score {
  // Largest weight, alpha times transmittance, in any pixel of any view; 1 for splats that too few views looked at, once all have been.
  contribution: f32,
  // Largest mean squared error of a view's picture without the splat; while the views are looked at its largest energy.
  removal: f32,
  // Sum of the energies of all views.
  energy: f32,
  // Views in whose frame the centre lies.
  looks: u32,
}

const SCORE_GROUP = 64u;

// Numbers that come before the coefficients of a lower degree in what is known of a splat: an error for each lower degree of the scene, and the
// coefficients of degrees below that one. With the scene's own degree: all of them.
fn lowered_numbers(sh_degree: u32, degree: u32) -> u32 {
  return sh_degree + degree * (degree + 1u) * (2u * degree + 1u) / 2u;
}
