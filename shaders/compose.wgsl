// Composes by drawing, so that the target may have any renderable format.
#import shared/compose
#import shared/full_screen
#import shared/srgb

// True for targets that apply the sRGB encoding on store: colors are decoded before, because scenes are trained in
// encoded colors.
override is_encoding: bool = false;

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
  let color = composed(position.xy);
  if (is_encoding) { return vec4f(decoded(color.rgb), color.a); }
  return color;
}
