// Color of a splat from its spherical harmonics, in the layout of the renderer's pack/sh.ts. The importing module
// declares `view`, and `sh_word`, which loads them.
#import shared/sh

// Color contribution of four coefficients in three words, or of one coefficient in the last word of degrees 0 and 2.
fn quartet_color(first_word: u32, basis: vec4f) -> vec3f {
  let a = sh_word(first_word);
  let b = sh_word(first_word + 1u);
  let c = sh_word(first_word + 2u);
  let h = array<vec2f, 6>(
    unpack2x16float(a.x), unpack2x16float(a.y), unpack2x16float(b.x),
    unpack2x16float(b.y), unpack2x16float(c.x), unpack2x16float(c.y),
  );
  return basis.x * vec3f(h[0], h[1].x) + basis.y * vec3f(h[1].y, h[2])
    + basis.z * vec3f(h[3], h[4].x) + basis.w * vec3f(h[4].y, h[5]);
}

fn single_color(word: u32, basis: f32) -> vec3f {
  let w = sh_word(word);
  return basis * vec3f(unpack2x16float(w.x), unpack2x16float(w.y).x);
}

fn half_color(first: u32, degree: u32, d: vec3f) -> vec3f {
  switch degree {
    case 0u: { return single_color(first, SH_C0); }
    case 1u: { return quartet_color(first, sh_basis(0u, d)); }
    case 2u: {
      return quartet_color(first, sh_basis(0u, d)) + quartet_color(first + 3u, sh_basis(1u, d))
        + single_color(first + 6u, sh_basis(2u, d).x);
    }
    default: {
      var color = vec3f(0.0);
      for (var q = 0u; q < 4u; q++) { color += quartet_color(first + 3u * q, sh_basis(q, d)); }
      return color;
    }
  }
}

// The 12 codes, four coefficients of three channels, from `word` and the two halves that follow it.
fn codes_color(a: u32, b: u32, c: u32, weights: vec4f) -> vec3f {
  let p = unpack4x8snorm(a);
  let q = unpack4x8snorm(b);
  let r = unpack4x8snorm(c);
  return weights.x * p.xyz + weights.y * vec3f(p.w, q.xy) + weights.z * vec3f(q.zw, r.x) + weights.w * r.yzw;
}

// Degree 0 in float16, then 8-bit codes in the order [coefficient][channel] with a scale for each band.
fn int8_color(first: u32, degree: u32, d: vec3f) -> vec3f {
  let head = sh_word(first);
  var color = SH_C0 * vec3f(unpack2x16float(head.x), unpack2x16float(head.y).x);
  if (degree == 0u) { return color; }
  let scale_1 = sh_scale((head.y >> 16u) & 255u);
  let scale_2 = sh_scale(head.y >> 24u);
  let low = sh_basis(0u, d);
  let middle = sh_basis(1u, d);
  let a = sh_word(first + 1u);
  if (degree == 1u) {
    let rest = unpack4x8snorm(a.y);
    let p = unpack4x8snorm(a.x);
    // The ninth code follows these eight; splats of degree 1 have it in place of the scale of band 2.
    var last = unpack4x8snorm(head.y).w;
    if (view.sh_degree > 1u) { last = unpack4x8snorm(sh_word(first + 2u).x).x; }
    return color + scale_1 * (low.y * p.xyz + low.z * vec3f(p.w, rest.xy) + low.w * vec3f(rest.zw, last));
  }
  let b = sh_word(first + 2u);
  let c = sh_word(first + 3u);
  color += codes_color(a.x, a.y, b.x, vec4f(scale_1 * low.yzw, scale_2 * middle.x));
  color += codes_color(b.y, c.x, c.y, scale_2 * vec4f(middle.yzw, sh_basis(2u, d).x));
  if (degree == 2u) { return color; }
  let e = sh_word(first + 4u);
  let f = sh_word(first + 5u);
  let g = sh_word(first + 6u);
  let scale_3 = sh_scale((g.y >> 8u) & 255u);
  let high = sh_basis(2u, d);
  let top = sh_basis(3u, d);
  color += codes_color(e.x, e.y, f.x, scale_3 * vec4f(high.yzw, top.x));
  return color + codes_color(f.y, g.x, g.y, scale_3 * vec4f(top.yzw, 0.0));
}

// sRGB-encoded color of splat i seen along the unit direction d; may exceed 1.
fn splat_sh_color(i: u32, d: vec3f) -> vec3f {
  let first = i * sh_stride(view.sh_degree, view.sh_encoding);
  let degree = min(view.sh_degree, view.sh_cap);
  var color: vec3f;
  if (view.sh_encoding == SH_FLOAT16) { color = half_color(first, degree, d); } else { color = int8_color(first, degree, d); }
  return max(color + 0.5, vec3f(0.0));
}
