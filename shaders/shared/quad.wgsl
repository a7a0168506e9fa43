// A quad just large enough for alpha >= 1/255 of a splat. The importing module declares `raster`.
#import shared/splat
#import shared/falloff

// Enlarges quads by this many pixels: rasterizers snap vertices, some of them to 1/16 of a pixel, and the quad of a
// splat with an opacity just above ALPHA_MIN may be smaller than that.
const SNAP_MARGIN = 0.0625;
// Quads with a larger half extent in pixels are drawn as their box clipped to the image.
const MAX_REACH = 8192.0;

fn quad_corner(s: ProjectedSplat, opacity: f32, corner: vec2f) -> vec2f {
  let sigma_x = 1.0 / s.shape.z;
  let slope = s.shape.w;
  let sigma_v = 1.0 / bitcast<f32>(s.paint.x);
  let radius = cutoff_radius(opacity);
  let half_width = radius * sigma_x + SNAP_MARGIN;
  let half_height = radius * sqrt(slope * slope * sigma_x * sigma_x + sigma_v * sigma_v) + SNAP_MARGIN;
  if (max(half_width, half_height) > MAX_REACH) {
    let box = s.shape.xy + corner * vec2f(half_width, half_height);
    return clamp(box, vec2f(-1.0), raster.viewport + 1.0);
  }
  // The square around the circle of that radius in (u, v) is as tight as a rectangle along the axes of the ellipse.
  let dx = corner.x * half_width;
  return s.shape.xy + vec2f(dx, slope * dx + corner.y * (radius * sigma_v + SNAP_MARGIN * (1.0 + abs(slope))));
}

// Clip-space position of a vertex of a splat's quad: the lower two bits of its index select the corner.
fn place_of(s: ProjectedSplat, vertex_index: u32) -> vec4f {
  let corner = vec2f(f32(vertex_index & 1u), f32((vertex_index >> 1u) & 1u)) * 2.0 - 1.0;
  let pixel = quad_corner(s, bitcast<f32>(s.paint.w), corner);
  return vec4f((pixel / raster.viewport * 2.0 - 1.0) * vec2f(1.0, -1.0), 0.0, 1.0);
}
