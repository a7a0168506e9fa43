// Draws quads of splats in a scene without meshes.
#import shared/quads
#import shared/plain_quad

@vertex
fn vertex(@builtin(vertex_index) vertex_index: u32, @builtin(instance_index) instance: u32) -> Quad {
  let slot = slot_of(vertex_index, instance);
  if (slot == NO_SLOT) { return no_quad(); }
  return quad_of(splats[slot], vertex_index);
}
