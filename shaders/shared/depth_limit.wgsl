// How the depth that a host has drawn hides splats.
struct SceneDepth {
  // A stored value d is the camera depth (x d + y) / (z d + w) in world units.
  inverse: vec4f,
  // Texels for each pixel that is drawn, across and down.
  scale: vec2f,
  // What is stored where there is nothing.
  nothing: f32,
}

const NO_LIMIT = 3e38;

// Camera depth behind which splats are hidden.
fn depth_limit(scene: SceneDepth, stored: f32) -> f32 {
  let below = scene.inverse.z * stored + scene.inverse.w;
  let depth = (scene.inverse.x * stored + scene.inverse.y) / below;
  return select(depth, NO_LIMIT, stored == scene.nothing || below <= 0.0);
}
