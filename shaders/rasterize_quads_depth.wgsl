// Draws quads with what else is in the picture: splats behind that are left out, pixel by pixel.
#import shared/scene_depth
#import shared/quads

@group(0) @binding(4) var<uniform> scene: SceneDepth;
// Camera depths by slot.
@group(0) @binding(5) var<storage, read> depths: array<f32>;
@group(0) @binding(6) var stored_depth: texture_2d<f32>;

struct DeepQuad {
  @builtin(position) position: vec4f,
  @location(0) @interpolate(flat, either) shape: vec4f,
  // red, green, blue, opacity
  @location(1) @interpolate(flat, either) color: vec4f,
  @location(2) @interpolate(flat, either) inverse_sigma_v: f32,
  @location(3) @interpolate(flat, either) depth: f32,
}

@vertex
fn vertex(@builtin(vertex_index) vertex_index: u32, @builtin(instance_index) instance: u32) -> DeepQuad {
  let slot = slot_of(vertex_index, instance);
  if (slot == NO_SLOT) { return DeepQuad(vec4f(2.0, 2.0, 0.0, 1.0), vec4f(0.0), vec4f(0.0), 0.0, 0.0); }
  let s = splats[slot];
  let color = vec4f(splat_color(s), bitcast<f32>(s.paint.w));
  return DeepQuad(place_of(s, vertex_index), s.shape, color, bitcast<f32>(s.paint.x), depths[slot]);
}

@fragment
fn fragment(quad: DeepQuad) -> @location(0) vec4f {
  let texel = vec2u(floor(quad.position.xy) * scene.scale + 0.5 * scene.scale);
  if (quad.depth > depth_limit(scene, textureLoad(stored_depth, texel, 0).r)) { discard; }
  let offset = quad.position.xy - quad.shape.xy;
  let alpha = alpha_at(offset, quad.shape.z, quad.shape.w, quad.inverse_sigma_v, quad.color.a);
  if (alpha < ALPHA_MIN) { discard; }
  // Blended as colour = alpha · color + (1 - alpha) · colour and transmittance = (1 - alpha) · transmittance.
  return vec4f(quad.color.rgb * alpha, alpha);
}
