// Paints tiles with meshes in the scene: a pixel ends at their depth; and writes the depth of the splats.
#import shared/scene_depth
#import shared/paint_columns
#import shared/median_depth

@group(0) @binding(7) var<uniform> scene: SceneDepth;
// Camera depths by slot.
@group(0) @binding(8) var<storage, read> depths: array<f32>;
@group(0) @binding(9) var stored_depth: texture_2d<f32>;
// Receives the depth at which half of the light is gone; 0 where more passes.
@group(0) @binding(10) var median_depth: texture_storage_2d<r32float, write>;

override tests_depth: bool = true;
override tells_depth: bool = false;

var<private> limits: Column;

fn load_more(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) { batch_depths[k] = depths[slot]; }

fn start_hiding(position: vec2u) {
  if (!tests_depth) { return; }
  for (var row = 0u; row < COLUMN; row++) {
    let texel = vec2u((vec2f(position + vec2u(0u, row)) + 0.5) * scene.scale);
    limits[row] = depth_limit(scene, textureLoad(stored_depth, texel, 0).r);
  }
}

// Splats behind a hidden one are hidden, too: no light is left for them.
fn hidden_by(light: Column, k: u32) -> Column {
  if (!tests_depth) { return light; }
  return select(light, Column(0.0), Column(batch_depths[k]) > limits);
}

fn clear_notes(lane: u32) {}

fn note_blend(k: u32, weight: Column, before: Column, after: Column, is_blended: vec4<bool>) {
  if (tells_depth) { note_depth(k, before, after, is_blended); }
}

fn keep_notes(k: u32) {}

fn note_pixel(pixel: vec2u, row: u32) {
  if (tells_depth) { textureStore(median_depth, pixel, vec4f(half_depth[row])); }
}
