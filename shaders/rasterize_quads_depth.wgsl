// Draws quads in a scene with meshes. Splats behind the depth of a mesh are discarded pixel by pixel; with layers,
// those that are not behind `part` layers.
#import shared/scene_depth
#import shared/quads

@group(0) @binding(4) var<uniform> scene: SceneDepth;
// Camera depths by slot.
@group(0) @binding(5) var<storage, read> depths: array<f32>;
@group(0) @binding(6) var stored_depth: texture_2d<f32>;
@group(0) @binding(7) var layer_color: texture_2d<f32>;
@group(0) @binding(8) var second_depth: texture_2d<f32>;
@group(0) @binding(9) var second_color: texture_2d<f32>;

override part: u32 = 0u;

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
  let texel = scene_texel(floor(quad.position.xy) + 0.5);
  var in_front = u32(quad.depth > limit_at(texel));
  if (layers == 2u) { in_front += u32(quad.depth > depth_limit(scene, textureLoad(second_depth, texel, 0).r)); }
  if (in_front != part) { discard; }
  let offset = quad.position.xy - quad.shape.xy;
  let alpha = alpha_at(offset, quad.shape.z, quad.shape.w, quad.inverse_sigma_v, quad.color.a);
  if (alpha < ALPHA_MIN) { discard; }
  // Blended as color = alpha · color + (1 - alpha) · color behind, and transmittance = (1 - alpha) · transmittance.
  return vec4f(quad.color.rgb * alpha, alpha);
}
