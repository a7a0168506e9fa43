// Blends one layer of the meshes over the splats behind it, for the rasterizer with quads.
#import shared/scene_depth
#import shared/full_screen

@group(0) @binding(0) var<uniform> scene: SceneDepth;
@group(0) @binding(1) var stored_depth: texture_2d<f32>;
@group(0) @binding(2) var layer_color: texture_2d<f32>;
@group(0) @binding(3) var second_depth: texture_2d<f32>;
@group(0) @binding(4) var second_color: texture_2d<f32>;

// Index of the layer, counted from the nearest.
override nth: u32 = 0u;

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
  return layer_at(scene_texel(floor(position.xy) + 0.5), nth).color;
}
