// Groups of splats, such as the objects of a segmented scene. Cuts may be limited to some of them.
#import shared/modifiers

// Texels of 16 bits: in the first `modifiers.group_rows` rows the cuts of each group, one bit each, then the group of
// each splat of the block. A texture, because the stages use all storage buffers that WebGPU guarantees.
@group(0) @binding(10) var groups: texture_2d<f32>;

const GROUPS_WIDTH = 2048u;

fn group_texel(k: u32) -> u32 {
  let bytes = round(255.0 * textureLoad(groups, vec2u(k % GROUPS_WIDTH, k / GROUPS_WIDTH), 0).xy);
  return u32(bytes.x) | (u32(bytes.y) << 8u);
}

// Cuts that apply to the group of a splat, one bit each: all in a scene without groups.
fn cuts_of_group(i: u32) -> u32 {
  if (modifiers.group_rows == 0u) { return 0xffffffffu; }
  return group_texel(group_texel(modifiers.group_rows * GROUPS_WIDTH + i));
}
