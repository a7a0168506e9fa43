// Paints tiles and notes nothing.
#import shared/nothing_else
#import shared/paint_listed

const NOTES_SPLATS = false;

fn load_more(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) {}
fn clear_notes(lane: u32) {}
fn note_blend(k: u32, weight: f32, before: f32, after: f32, blue_depth: u32) {}
fn keep_notes(k: u32) {}
fn note_pixel(pixel: vec2u) {}
