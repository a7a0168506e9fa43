// Paints tiles, and notes what each splat contributed and how deep each pixel is.
#import shared/nothing_else
#import shared/paint_listed

const NOTES_SPLATS = true;

// Numbers of the splats by slot.
@group(0) @binding(6) var<storage, read> survivors: array<u32>;
// By number: bits of the largest weight, alpha times transmittance, that the splat has had in any pixel of any frame.
@group(0) @binding(7) var<storage, read_write> contributions: array<atomic<u32>>;
// Camera depth, in world units, of the splat that leaves a pixel half transparent or less; 0 where none does.
@group(0) @binding(8) var depths: texture_storage_2d<r32float, write>;

// Slots of the splats of the batch.
var<workgroup> slots: array<u32, TILE_THREADS>;
// Largest weight of each splat of the batch, and of the one that takes the place of a missing one.
var<workgroup> weights: array<atomic<u32>, TILE_THREADS + 1u>;
var<private> half_depth: f32;

fn load_more(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) { slots[k] = slot; }

fn clear_notes(lane: u32) {
  atomicStore(&weights[lane], 0u);
}

fn note_blend(k: u32, weight: f32, before: f32, after: f32, blue_depth: u32) {
  atomicMax(&weights[k], bitcast<u32>(weight));
  if (before > 0.5 && after <= 0.5) { half_depth = depth_in(blue_depth); }
}

fn keep_notes(k: u32) {
  let number = survivors[slots[k]];
  if (number < arrayLength(&contributions)) { atomicMax(&contributions[number], atomicLoad(&weights[k])); }
}

fn note_pixel(pixel: vec2u) {
  textureStore(depths, pixel, vec4f(half_depth));
}
