// Rasterizes tiles, and writes the contribution of each splat.
#import shared/paint_columns
#import shared/whole_lists
#import shared/column_rows

// Indices of the splats by slot.
@group(0) @binding(7) var<storage, read> survivors: array<u32>;
// Index is that of the splat: bits of its largest weight, alpha times transmittance, in any pixel of any frame.
@group(0) @binding(8) var<storage, read_write> contributions: array<atomic<u32>>;

// Slots of the splats of the batch.
var<workgroup> slots: array<u32, BATCH>;
// Largest weight of each splat of the batch, and of the placeholder for missing ones.
var<workgroup> weights: array<atomic<u32>, BATCH + 1u>;

fn load_more(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) { slots[k] = slot; }

fn start_hiding(position: vec2u) {}
fn hide(pixels: ptr<function, Pixels>, k: u32) {}
fn hide_rest(pixels: ptr<function, Pixels>) {}

fn aux_clear(lane: u32) {
  atomicStore(&weights[lane], 0u);
}

fn aux_blend(k: u32, weight: Column, before: Column, after: Column, is_blended: Flags) {
  atomicMax(&weights[k], bitcast<u32>(largest(weight)));
}

fn aux_store(k: u32) {
  let number = survivors[slots[k]];
  if (number < arrayLength(&contributions)) { atomicMax(&contributions[number], atomicLoad(&weights[k])); }
}

fn aux_pixel(pixel: vec2u, row: u32) {}
