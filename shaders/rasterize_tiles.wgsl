// Rasterizes tiles without auxiliary outputs.
#import shared/paint_columns
#import shared/whole_lists

fn load_more(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) {}
fn start_hiding(position: vec2u) {}
fn hide(pixels: ptr<function, Pixels>, k: u32) {}
fn hide_rest(pixels: ptr<function, Pixels>) {}
fn aux_clear(lane: u32) {}
fn aux_blend(k: u32, weight: Column, before: Column, after: Column, is_blended: Flags) {}
fn aux_store(k: u32) {}
fn aux_pixel(pixel: vec2u, row: u32) {}
