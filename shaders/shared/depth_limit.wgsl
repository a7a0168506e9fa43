// The depth buffer of a host, which hides splats.
struct SceneDepth {
  // A stored value d is the camera depth (x d + y) / (z d + w) in world units.
  inverse: vec4f,
  // Texels for each drawn pixel, across and down.
  scale: vec2f,
  // Clear value of the depth buffer.
  nothing: f32,
}

const NO_LIMIT = 3e38;

// Camera depth behind which splats are hidden.
fn depth_limit(scene: SceneDepth, stored: f32) -> f32 {
  let below = scene.inverse.z * stored + scene.inverse.w;
  let depth = (scene.inverse.x * stored + scene.inverse.y) / below;
  return select(depth, NO_LIMIT, stored == scene.nothing || below <= 0.0);
}
