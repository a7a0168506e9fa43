// Paints tiles and notes nothing.
#import shared/nothing_else
#import shared/paint_tiles

const NOTES_SPLATS = false;

fn clear_notes(lane: u32) {}
fn note_blend(k: u32, weight: f32, before: f32, after: f32, blue_depth: u32) {}
fn keep_notes(k: u32, slot: u32) {}
fn note_pixel(pixel: vec2u) {}
