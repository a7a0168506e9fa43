// `compose` onto a canvas, whose rows WebGL counts from below.
#import shared/compose
#import shared/full_screen

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
  let height = compose.used.y / compose.scale.y;
  return composed(vec2f(position.x, height - position.y));
}
