// Projects the survivors of a page: screen ellipse, colour from spherical harmonics, and the depth key of the sort.
#import shared/projection
#import shared/sh
#import shared/splat
#import shared/plan
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<PackedGaussian>;
// float16 coefficients, [splat][coefficient][channel], each splat padded to whole words
@group(0) @binding(2) var<storage, read> sh: array<vec2u>;
@group(0) @binding(3) var<storage, read> survivors: array<u32>;
@group(0) @binding(4) var<storage, read> plan: PlanView;
@group(0) @binding(5) var<storage, read_write> splats: array<ProjectedSplat>;
@group(0) @binding(6) var<storage, read_write> keys: array<u32>;

// Colour that four coefficients in three words add, or one coefficient in the last word of degrees 0 and 2.
fn quartet_color(first_word: u32, basis: vec4f) -> vec3f {
  let a = sh[first_word];
  let b = sh[first_word + 1u];
  let c = sh[first_word + 2u];
  let h = array<vec2f, 6>(
    unpack2x16float(a.x), unpack2x16float(a.y), unpack2x16float(b.x),
    unpack2x16float(b.y), unpack2x16float(c.x), unpack2x16float(c.y),
  );
  return basis.x * vec3f(h[0], h[1].x) + basis.y * vec3f(h[1].y, h[2])
    + basis.z * vec3f(h[3], h[4].x) + basis.w * vec3f(h[4].y, h[5]);
}

fn single_color(word: u32, basis: f32) -> vec3f {
  let w = sh[word];
  return basis * vec3f(unpack2x16float(w.x), unpack2x16float(w.y).x);
}

// sRGB-encoded colour of splat i seen along the unit direction d; may exceed 1.
fn splat_sh_color(i: u32, degree: u32, d: vec3f) -> vec3f {
  let first = i * sh_stride(degree);
  var color = vec3f(0.5);
  switch degree {
    case 0u: { color += single_color(first, SH_C0); }
    case 1u: { color += quartet_color(first, sh_basis(0u, d)); }
    case 2u: {
      color += quartet_color(first, sh_basis(0u, d)) + quartet_color(first + 3u, sh_basis(1u, d));
      color += single_color(first + 6u, sh_basis(2u, d).x);
    }
    default: {
      for (var q = 0u; q < 4u; q++) { color += quartet_color(first + 3u * q, sh_basis(q, d)); }
    }
  }
  return max(color, vec3f(0.0));
}

// Orders as the depth does. The bits of a positive float32, read as a number, grow like its logarithm: a share of the
// visible range of that number is a logarithmic key that needs no logarithm.
fn depth_key(depth: f32) -> u32 {
  let depth_bits = bitcast<u32>(depth);
  if (view.key_bits == 32u) { return depth_bits; }
  let nearest = ~plan.nearest_inverted;
  let range = f32(max(plan.farthest - nearest, 1u));
  // A depth computed anew may lie a rounding before the nearest one.
  let share = f32(max(depth_bits, nearest) - nearest) / range;
  return u32(min(share, 1.0) * f32((1u << view.key_bits) - 1u));
}

@compute @workgroup_size(PROJECT_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let page = plan.pages[view.page];
  let rank = group_index(workgroup_id) * PROJECT_GROUP + lane;
  if (rank >= page.survivors) { return; }
  let slot = page.first_slot + rank;
  let i = survivors[slot];
  let g = unpack_gaussian(gaussians[i]);
  let e = project_ellipse(view, g);
  let color = splat_sh_color(i, view.sh_degree, normalize(g.position - view.eye));
  splats[slot] = pack_splat(e.center, e.sigma_x, e.slope, e.sigma_v, color, e.opacity);
  keys[slot] = depth_key(e.depth);
}
