// Composes by drawing, into any renderable target.
#import shared/compose

@vertex
fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
  // One triangle that covers the image.
  return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// True for targets that encode what is written: colours are encoded already, as scenes are trained.
override is_encoding: bool = false;

// IEC 61966-2-1.
fn decoded(c: vec3f) -> vec3f {
  return select(pow((max(c, vec3f(0.0)) + 0.055) / 1.055, vec3f(2.4)), c / 12.92, c <= vec3f(0.04045));
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
  let color = composed(position.xy);
  if (is_encoding) { return vec4f(decoded(color.rgb), color.a); }
  return color;
}
