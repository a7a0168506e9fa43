// Applies modifiers to splats: cuts, then the hook of the page, then the reveal effect. Variants of the stages that
// read Gaussians (`cull_modified` of `cull` and so on: scripts/build-shaders.mjs) call these functions instead of
// `gaussian_at`, `unpack_gaussian` and `pack_splat`.
#import shared/cut
#import shared/splat_groups
#import shared/splat_hook
#import shared/stored_gaussian
#import shared/scene_opacity
#import shared/splat

// Limit of the enlargement of splats that represent others.
const COARSEST_SHARE = 0.015625;
// Fraction of the reveal during which one splat fades in.
const SHARE_RAMP = 0.1;
// Bits of the largest length whose square is finite.
const FARTHEST_BITS = 0x5d000000u;
const LARGEST_SCALE = 1000.0;
// Minimum scale: a splat without a size would have no image.
const SMALLEST_SCALE = 1e-4;

// State of the current splat: its index in the block, rows of the affine map of colors that the cuts make together, and
// the arguments of the hook.
var<private> splat_index: u32;
var<private> cut_has_color: bool;
var<private> cut_red: vec4f;
var<private> cut_green: vec4f;
var<private> cut_blue: vec4f;
var<private> hooked_position: vec3f;
var<private> hooked_opacity: f32;
var<private> visible_opacity: f32;

// Rejects infinities and out-of-range values of a hook, so that they do not propagate.
fn is_bounded(x: f32) -> bool {
  return (bitcast<u32>(x) & 0x7fffffffu) < FARTHEST_BITS;
}

fn bounded(x: f32, otherwise: f32, low: f32, high: f32) -> f32 {
  if (!is_bounded(x)) { return otherwise; }
  return clamp(x, low, high);
}

fn scale_gaussian(g: ptr<function, Gaussian>, factor: f32) {
  (*g).factor_x *= factor;
  (*g).factor_y *= factor;
  (*g).factor_z *= factor;
}

// Appends a fraction of the map of a cut to the map of colors.
fn compose_colors(k: u32, share: f32) {
  let red = mapped_row(modifiers.cuts[k].red);
  let green = mapped_row(modifiers.cuts[k].green);
  let blue = mapped_row(modifiers.cuts[k].blue);
  cut_red = mix(cut_red, red, share);
  cut_green = mix(cut_green, green, share);
  cut_blue = mix(cut_blue, blue, share);
  cut_has_color = true;
}

// Row of the product of a map of colors and the map until now.
fn mapped_row(row: vec4f) -> vec4f {
  return row.x * cut_red + row.y * cut_green + row.z * cut_blue + vec4f(0.0, 0.0, 0.0, row.w);
}

fn apply_cuts(g: ptr<function, Gaussian>) {
  let found = *g;
  cut_has_color = false;
  cut_red = vec4f(1.0, 0.0, 0.0, 0.0);
  cut_green = vec4f(0.0, 1.0, 0.0, 0.0);
  cut_blue = vec4f(0.0, 0.0, 1.0, 0.0);
  let cuts = cuts_of_group(splat_index);
  for (var k = 0u; k < modifiers.cut_count; k++) {
    let inside = select(0.0, share_in_shape(k, found), ((cuts >> k) & 1u) != 0u);
    let share = select(inside, 1.0 - inside, modifiers.cuts[k].is_outside != 0u);
    if (share <= 0.0) { continue; }
    if (modifiers.cuts[k].has_color != 0u) { compose_colors(k, share); }
    let mass = mix(1.0, modifiers.cuts[k].opacity, share);
    if (share < 1.0 && mass < 1.0 && mass > MIN_MASS && modifiers.cuts[k].edge >= 0.0) {
      trim_gaussian(g, found, k, inside);
    } else {
      (*g).opacity *= mass;
    }
    (*g).opacity = thinned_opacity((*g).opacity, mix(1.0, modifiers.cuts[k].thinned, share));
    (*g).position += share * modifiers.cuts[k].offset;
  }
}

fn hook_values(color: vec3f) -> mat3x3f {
  return splat_hook(hooked_position, color, hooked_opacity, modifiers.time, modifiers.values);
}

// Applies position and size. A lower opacity is applied later with the color, on which it may depend.
fn apply_hook(g: ptr<function, Gaussian>) {
  if (modifiers.is_hooked == 0u) { return; }
  let p = vec4f((*g).position, 1.0);
  hooked_position = vec3f(dot(modifiers.to_viewer_x, p), dot(modifiers.to_viewer_y, p), dot(modifiers.to_viewer_z, p));
  hooked_opacity = (*g).opacity;
  let wanted = hook_values(vec3f(0.0));
  let moved = wanted[0] - hooked_position;
  if (is_bounded(moved.x) && is_bounded(moved.y) && is_bounded(moved.z)) {
    (*g).position += moved.x * modifiers.from_viewer_x + moved.y * modifiers.from_viewer_y + moved.z * modifiers.from_viewer_z;
  }
  scale_gaussian(g, bounded(wanted[2].y, 1.0, SMALLEST_SCALE, LARGEST_SCALE));
  (*g).opacity = max((*g).opacity, bounded(wanted[2].x, 0.0, 0.0, 1.0));
  visible_opacity = (*g).opacity;
}

// Pseudo-random number in 0..1 that depends only on the position.
fn random_of(position: vec3f) -> f32 {
  let bits = bitcast<vec3u>(position) * vec3u(0x9e3779b1u, 0x85ebca77u, 0xc2b2ae3du);
  var h = bits.x ^ (bits.y >> 7u) ^ (bits.z << 9u);
  h = (h ^ (h >> 15u)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12u)) * 0x297a2d39u;
  return f32((h ^ (h >> 15u)) >> 8u) / 16777216.0;
}

fn apply_reveal(g: ptr<function, Gaussian>) {
  if (modifiers.share < 1.0) {
    let share = max(modifiers.share, COARSEST_SHARE);
    (*g).opacity *= clamp((share * (1.0 + SHARE_RAMP) - random_of((*g).position)) / SHARE_RAMP, 0.0, 1.0);
    scale_gaussian(g, inverseSqrt(share));
  }
  if (modifiers.grown < 1.0) {
    (*g).position = modifiers.center + modifiers.grown * ((*g).position - modifiers.center);
    scale_gaussian(g, max(modifiers.grown, SMALLEST_SCALE));
    if (modifiers.grown <= 0.0) { (*g).opacity = 0.0; }
  }
}

fn loaded_gaussian_at(i: u32) -> FoundGaussian {
  splat_index = i;
  return gaussian_at(i);
}

// The splat that was loaded last.
fn modified_gaussian(found: FoundGaussian) -> Gaussian {
  var g = unpack_gaussian(found);
  apply_cuts(&g);
  apply_hook(&g);
  apply_reveal(&g);
  return g;
}

// Packs a splat with its color, which `modified_gaussian` did not have yet.
fn pack_modified(ellipse: Ellipse, color: vec3f) -> ProjectedSplat {
  var e = ellipse;
  var c = color;
  if (cut_has_color) {
    let before = vec4f(c, 1.0);
    c = vec3f(dot(cut_red, before), dot(cut_green, before), dot(cut_blue, before));
  }
  if (modifiers.is_hooked != 0u) {
    let wanted = hook_values(c);
    let opacity = bounded(wanted[2].x, 0.0, 0.0, 1.0);
    e.opacity *= opacity / max(visible_opacity, 1e-6);
    c = vec3f(bounded(wanted[1].x, 0.0, 0.0, COLOR_MAX), bounded(wanted[1].y, 0.0, 0.0, COLOR_MAX), bounded(wanted[1].z, 0.0, 0.0, COLOR_MAX));
  }
  return pack_splat(e, c);
}
