// `cull` and `project` in one: one fragment for each splat of the scene, whose rows begin at `first_group`. Invisible
// splats get an opacity of 0.
#import shared/projection
#import shared/stored_gaussian
#import shared/sh_color
#import shared/splat
#import shared/full_screen

@group(0) @binding(0) var<uniform> view: View;

@group(0) @binding(2) var harmonics: texture_2d<u32>;

fn sh_word(i: u32) -> vec2u {
  return textureLoad(harmonics, texel_of(i), 0).xy;
}

struct Projected {
  // The bits of the floats.
  @location(0) shape: vec4u,
  @location(1) paint: vec4u,
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> Projected {
  let i = (u32(position.y) - view.first_group) * DATA_WIDTH + u32(position.x);
  if (i >= view.splat_count) { return Projected(vec4u(0u), vec4u(0u)); }
  let found = gaussian_at(i);
  let g = unpack_gaussian(found);
  let depth = in_camera(view, g.position).z;
  if (!is_usable(found) || g.opacity < ALPHA_MIN || !is_in_depth_range(view, depth)) { return Projected(vec4u(0u), vec4u(0u)); }
  let e = project_ellipse(view, g);
  if (!covers_a_pixel(view, e)) { return Projected(vec4u(0u), vec4u(0u)); }
  let toward = select(g.position - view.eye, view.axis, view.is_orthographic != 0u);
  let s = pack_splat(e, splat_sh_color(i, normalize(toward)));
  return Projected(bitcast<vec4u>(s.shape), s.paint);
}
