// `quads` in a frame of a host: splats behind its depth are discarded pixel by pixel.
#import shared/quad
#import shared/plan
#import shared/depth_limit
#import webgl/projected_splats

@group(0) @binding(0) var<uniform> raster: HostedView;

@group(0) @binding(4) var stored_depth: texture_2d<f32>;

struct HostedView {
  // Pixels.
  viewport: vec2f,
  // Number of splats in the order.
  count: u32,
  // Clear value of the depth buffer.
  nothing: f32,
  // See SceneDepth.
  inverse: vec4f,
  // Texels for each drawn pixel.
  scale: vec2f,
  // Texel of the upper left corner; rows are counted from the bottom.
  corner: vec2f,
}

struct HostedQuad {
  @builtin(position) position: vec4f,
  @location(0) @interpolate(flat, either) shape: vec4f,
  @location(1) @interpolate(flat, either) color: vec4f,
  @location(2) @interpolate(flat, either) inverse_sigma_v: f32,
  @location(3) @interpolate(flat, either) depth: f32,
}

@vertex
fn vertex(@builtin(vertex_index) vertex_index: u32, @builtin(instance_index) instance: u32) -> HostedQuad {
  let rank = instance * QUAD_BATCH + vertex_index / 4u;
  let s = splat_at(raster.count - 1u - min(rank, raster.count - 1u));
  if (rank >= raster.count || s.paint.w == 0u) { return HostedQuad(vec4f(2.0, 2.0, 0.0, 1.0), vec4f(0.0), vec4f(0.0), 0.0, 0.0); }
  let color = vec4f(splat_color(s), bitcast<f32>(s.paint.w));
  return HostedQuad(place_of(s, vertex_index), s.shape, color, bitcast<f32>(s.paint.x), splat_depth(s));
}

@fragment
fn fragment(quad: HostedQuad) -> @location(0) vec4f {
  let place = floor(quad.position.xy) + 0.5;
  let texel = raster.corner + vec2f(place.x, -place.y) * raster.scale;
  let stored = textureLoad(stored_depth, vec2u(texel), 0).r;
  let scene = SceneDepth(raster.inverse, raster.scale, raster.nothing);
  if (quad.depth > depth_limit(scene, stored)) { discard; }
  let offset = quad.position.xy - quad.shape.xy;
  let alpha = alpha_at(offset, quad.shape.z, quad.shape.w, quad.inverse_sigma_v, quad.color.a);
  if (alpha < ALPHA_MIN) { discard; }
  return vec4f(quad.color.rgb * alpha, alpha);
}
