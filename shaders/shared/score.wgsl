// Scores of a splat over the rendered views. Scenes are scored in blocks of as many splats as a binding holds.
struct Score {
  // Largest weight, alpha times transmittance, in any pixel of any view; finally 1 for splats that too few views
  // contain.
  contribution: f32,
  // Largest mean squared error of the image of a view without the splat; its largest energy until the last view.
  removal: f32,
  // Sum of the energies of all views.
  energy: f32,
  // Views whose frame contains the center.
  looks: u32,
}

const SCORE_GROUP = 64u;

// Numbers before the coefficients of a lower degree in the data of a splat: an error for each lower degree of the
// scene, and the coefficients of the degrees below. For the scene's own degree it is their total.
fn lowered_numbers(sh_degree: u32, degree: u32) -> u32 {
  return sh_degree + degree * (degree + 1u) * (2u * degree + 1u) / 2u;
}
