// The hook of a page, called for each splat: packages/renderer/src/modifiers/splat-shader.ts replaces the text of this file.
#import shared/modifiers

// Returns the columns position, color, and (opacity, factor of the size, 0).
fn splat_hook(position: vec3f, color: vec3f, opacity: f32, time: f32, values: array<vec4f, MAX_VALUES>) -> mat3x3f {
  return mat3x3f(position, color, vec3f(opacity, 1.0, 0.0));
}
