// Rasterizes whole lists, one tile or square for each workgroup.
#import shared/paint_tiles

fn dim_batch(pixels: ptr<function, Pixels>, own_block: u32, place: vec2f, min_power: f32) {}

@compute @workgroup_size(TILE_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let tile = place_of(group_index(workgroup_id) * view.parts + view.part);
  if (is_seen(view, tile.corner)) { _ = paint_whole(tile, lane); }
}
