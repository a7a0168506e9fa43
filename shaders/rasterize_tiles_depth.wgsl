// Rasterizes tiles in a scene with meshes, which end pixels or are blended as layers; also writes the depth of the
// splats.
#import shared/scene_depth
#import shared/paint_columns
#import shared/whole_lists
#import shared/column_rows
#import shared/median_depth

@group(0) @binding(7) var<uniform> scene: SceneDepth;
// Camera depths by slot.
@group(0) @binding(8) var<storage, read> depths: array<f32>;
@group(0) @binding(9) var stored_depth: texture_2d<f32>;
// Receives the depth that halves the transmittance; 0 if more light passes.
@group(0) @binding(10) var median_depth: texture_storage_2d<r32float, write>;
@group(0) @binding(11) var layer_color: texture_2d<f32>;
@group(0) @binding(12) var second_depth: texture_2d<f32>;
@group(0) @binding(13) var second_color: texture_2d<f32>;

override tests_depth: bool = true;
override writes_depth: bool = false;

// State of a thread's pixels: the topmost one, the depth of the next layer of each, and their numbers of blended
// layers.
var<private> topmost: vec2u;
var<private> limits: Column;
var<private> passed: Column;

fn load_more(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) { batch_depths[k] = depths[slot]; }

fn texel_of(row: u32) -> vec2u { return scene_texel(vec2f(topmost + vec2u(0u, row)) + 0.5); }

fn start_hiding(position: vec2u) {
  if (!tests_depth) { return; }
  topmost = position;
  for (var row = 0u; row < COLUMN; row++) {
    if (layers == 0u) { limits = with_row(limits, row, limit_at(texel_of(row))); }
    else { limits = with_row(limits, row, layer_at(texel_of(row), 0u).depth); }
  }
}

// Blends the next layer of a pixel, unless the pixel is finished.
fn blend_layer(pixels: ptr<function, Pixels>, row: u32) {
  let nth = row_of(passed, row);
  let layer = layer_at(texel_of(row), u32(nth));
  passed = with_row(passed, row, nth + 1.0);
  limits = with_row(limits, row, layer_at(texel_of(row), u32(nth) + 1u).depth);
  let before = row_of((*pixels).light, row);
  if (before <= view.transmittance_min) { return; }
  let own = with_row(Column(0.0), row, before);
  (*pixels).red += own * layer.color.r;
  (*pixels).green += own * layer.color.g;
  (*pixels).blue += own * layer.color.b;
  (*pixels).light = with_row((*pixels).light, row, before * (1.0 - layer.color.a));
  (*pixels).transmittance = with_row((*pixels).transmittance, row, row_of((*pixels).light, row));
}

// Runs before splat k of the batch, because nearer layers come first. A depth without a color layer blocks all light
// from behind.
fn hide(pixels: ptr<function, Pixels>, k: u32) {
  if (!tests_depth) { return; }
  let is_behind = Column(batch_depths[k]) > limits;
  if (layers == 0u) {
    (*pixels).light = select((*pixels).light, Column(0.0), is_behind);
  } else if (any(is_behind)) {
    for (var row = 0u; row < COLUMN; row++) {
      while (batch_depths[k] > row_of(limits, row)) { blend_layer(pixels, row); }
    }
  }
}

fn hide_rest(pixels: ptr<function, Pixels>) {
  if (!tests_depth) { return; }
  for (var row = 0u; row < COLUMN; row++) {
    while (u32(row_of(passed, row)) < layers) { blend_layer(pixels, row); }
  }
}

fn aux_clear(lane: u32) {}

fn aux_blend(k: u32, weight: Column, before: Column, after: Column, is_blended: Flags) {
  if (writes_depth) { note_depth(k, before, after, is_blended); }
}

fn aux_store(k: u32) {}

fn aux_pixel(pixel: vec2u, row: u32) {
  if (writes_depth) { textureStore(median_depth, pixel, vec4f(row_of(half_depth, row))); }
}
