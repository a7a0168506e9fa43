// `rasterize_quads` on the output of `project` of WebGL.
#import shared/plain_quad
#import shared/plan
#import webgl/projected_splats

@group(0) @binding(0) var<uniform> raster: QuadsView;

struct QuadsView {
  // Pixels.
  viewport: vec2f,
  // Number of splats in the order.
  count: u32,
  // Rank of the first quad, from the farthest.
  first: u32,
}

@vertex
fn vertex(@builtin(vertex_index) vertex_index: u32, @builtin(instance_index) instance: u32) -> Quad {
  let rank = raster.first + instance * QUAD_BATCH + vertex_index / 4u;
  let s = splat_at(raster.count - 1u - min(rank, raster.count - 1u));
  if (rank >= raster.count || s.paint.w == 0u) { return no_quad(); }
  return quad_of(s, vertex_index);
}
