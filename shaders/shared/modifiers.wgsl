// Modifiers of the splats of a scene, applied during projection. packages/renderer/src/modifiers writes them, in
// block-local coordinates.
#import shared/view

const MAX_CUTS = 16u;
const MAX_VALUES = 8u;
// Shapes of a cut, in their own coordinates: sides and diameters are 1, and the plane is y = 0.
const CUT_BOX = 0u;
const CUT_SPHERE = 1u;
const CUT_CYLINDER = 2u;
const CUT_PLANE = 3u;
const CUT_EVERYWHERE = 4u;

struct ModifierCut {
  // Rows of the affine map to the coordinates of the shape.
  to_shape_x: vec4f,
  to_shape_y: vec4f,
  to_shape_z: vec4f,
  // Rows of an affine map of colors.
  red: vec4f,
  green: vec4f,
  blue: vec4f,
  // Displacement.
  offset: vec3f,
  shape: u32,
  // Factor of the opacity.
  opacity: f32,
  // Factor of the optical depth (shared/scene_opacity).
  thinned: f32,
  // Standard deviation of the soft edge, in addition to that of the splat; if negative, only the center decides.
  edge: f32,
  // 1 if the cut changes the splats outside its shape.
  is_outside: u32,
  // 1 if the cut changes colors.
  has_color: u32,
  reserved_a: u32,
  reserved_b: u32,
  reserved_c: u32,
}

struct Modifiers {
  // Rows of the affine map to viewer space, and columns of the inverse of its linear part.
  to_viewer_x: vec4f,
  to_viewer_y: vec4f,
  to_viewer_z: vec4f,
  from_viewer_x: vec3f,
  cut_count: u32,
  from_viewer_y: vec3f,
  // 1 if the page defines a hook.
  is_hooked: u32,
  from_viewer_z: vec3f,
  // Seconds.
  time: f32,
  // Center of the reveal, and the current scale of the scene: 1 when complete.
  center: vec3f,
  grown: f32,
  // Fraction of the splats that represent all; 1 for all of them.
  share: f32,
  // 1 if splats may leave the bounds of their chunks.
  moves: u32,
  // Rows of `groups` with the cuts of groups; 0 for a scene without groups.
  group_rows: u32,
  reserved: u32,
  values: array<vec4f, MAX_VALUES>,
  cuts: array<ModifierCut, MAX_CUTS>,
}

@group(0) @binding(9) var<uniform> modifiers: Modifiers;
