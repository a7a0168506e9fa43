// `cull` and `project` in one: a fragment for each splat of the scene. What paints nothing has an opacity of 0.
#import shared/visibility
#import shared/sh_color
#import shared/splat
#import webgl/whole_target

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
  let i = u32(position.y) * DATA_WIDTH + u32(position.x);
  if (i >= view.splat_count) { return Projected(vec4u(0u), vec4u(0u)); }
  let found = gaussian_at(i);
  if (!is_usable(found) || visible_depth(found, 1.0) <= 0.0) { return Projected(vec4u(0u), vec4u(0u)); }
  let g = unpack_gaussian(found);
  let s = pack_splat(project_ellipse(view, g), splat_sh_color(i, normalize(g.position - view.eye)));
  return Projected(bitcast<vec4u>(s.shape), s.paint);
}
