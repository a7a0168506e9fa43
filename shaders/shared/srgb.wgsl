// Converts between linear light and the sRGB-encoded colors of scenes (IEC 61966-2-1).
fn decoded(c: vec3f) -> vec3f {
  return select(pow((max(c, vec3f(0.0)) + 0.055) / 1.055, vec3f(2.4)), c / 12.92, c <= vec3f(0.04045));
}
