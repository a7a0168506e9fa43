// Meshes that a host has drawn, as depth alone or as layers of color among the splats. Stages declare the textures:
// `stored_depth`, and for layers `layer_color`, `second_depth`, `second_color`; and the uniform `scene`.
#import shared/depth_limit

// Layers of color, up to 2; 0 if the depth only ends the pixel.
override layers: u32 = 0u;

struct Layer {
  // Premultiplied; alpha is the coverage of the pixel times the opacity.
  color: vec4f,
  // Camera depth; NO_LIMIT if there is no layer.
  depth: f32,
}

// Texel at a position in the image, in drawn pixels.
fn scene_texel(place: vec2f) -> vec2u { return vec2u(place * scene.scale); }

fn limit_at(texel: vec2u) -> f32 { return depth_limit(scene, textureLoad(stored_depth, texel, 0).r); }

// Layer number `nth` of a texel, counted from the nearest one.
fn layer_at(texel: vec2u, nth: u32) -> Layer {
  if (nth >= layers) { return Layer(vec4f(0.0), NO_LIMIT); }
  let first = Layer(textureLoad(layer_color, texel, 0), limit_at(texel));
  if (layers == 1u) { return first; }
  let second = Layer(textureLoad(second_color, texel, 0), depth_limit(scene, textureLoad(second_depth, texel, 0).r));
  let is_second = (second.depth < first.depth) == (nth == 0u);
  return Layer(select(first.color, second.color, is_second), select(first.depth, second.depth, is_second));
}
