// Paints tiles with what else is in the picture: a pixel ends at the depth of that; and tells the depth of what it has painted.
#import shared/scene_depth
#import shared/paint_listed

const NOTES_SPLATS = false;

@group(0) @binding(6) var<uniform> scene: SceneDepth;
// Camera depths by slot.
@group(0) @binding(7) var<storage, read> depths: array<f32>;
@group(0) @binding(8) var stored_depth: texture_2d<f32>;
// Receives the depth at which half of the light is gone; 0 where more passes.
@group(0) @binding(9) var median_depth: texture_storage_2d<r32float, write>;

override tests_depth: bool = true;
override tells_depth: bool = false;

// Of the splats of the batch, and of the one that takes the place of a missing one.
var<workgroup> batch_depths: array<f32, TILE_THREADS + 1u>;
var<private> limit: f32;
var<private> half_depth: f32;

fn load_more(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) { batch_depths[k] = depths[slot]; }

fn start_pixel(pixel: vec2u) {
  if (tests_depth) { limit = depth_limit(scene, textureLoad(stored_depth, vec2u((vec2f(pixel) + 0.5) * scene.scale), 0).r); }
}

fn is_hidden(k: u32) -> bool { return tests_depth && batch_depths[k] > limit; }

fn clear_notes(lane: u32) {}

fn note_blend(k: u32, weight: f32, before: f32, after: f32, blue_depth: u32) {
  if (tells_depth && before > 0.5 && after <= 0.5) { half_depth = batch_depths[k]; }
}

fn keep_notes(k: u32) {}

fn note_pixel(pixel: vec2u) {
  if (tells_depth) { textureStore(median_depth, pixel, vec4f(half_depth)); }
}
