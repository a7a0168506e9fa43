// Composes by drawing, into any renderable target.
#import shared/compose
#import shared/full_screen
#import shared/srgb

// True for targets that encode what is written: colours are encoded already, as scenes are trained.
override is_encoding: bool = false;

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
  let color = composed(position.xy);
  if (is_encoding) { return vec4f(decoded(color.rgb), color.a); }
  return color;
}
