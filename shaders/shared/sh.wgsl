// Real spherical harmonics up to degree 3 with the constants and signs of 3D Gaussian Splatting (Kerbl et al. 2023).
const SH_C0 = 0.28209479177387814;
const SH_C1 = 0.4886025119029199;
const SH_C2 = array<f32, 5>(1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792, 0.5462742152960396);
const SH_C3 = array<f32, 7>(
  -0.5900435899266435, 2.890611442640554, -0.4570457994644658, 0.3731763325901154,
  -0.4570457994644658, 1.445305721320277, -0.5900435899266435,
);

// Values of four consecutive basis functions (0-3, 4-7, 8-11, 12-15) in the unit direction d.
fn sh_basis(quartet: u32, d: vec3f) -> vec4f {
  let x = d.x; let y = d.y; let z = d.z;
  let xx = x * x; let yy = y * y; let zz = z * z;
  switch quartet {
    case 0u: { return vec4f(SH_C0, -SH_C1 * y, SH_C1 * z, -SH_C1 * x); }
    case 1u: { return vec4f(SH_C2[0] * x * y, SH_C2[1] * y * z, SH_C2[2] * (2.0 * zz - xx - yy), SH_C2[3] * x * z); }
    case 2u: {
      return vec4f(SH_C2[4] * (xx - yy), SH_C3[0] * y * (3.0 * xx - yy), SH_C3[1] * x * y * z, SH_C3[2] * y * (4.0 * zz - xx - yy));
    }
    default: {
      return vec4f(
        SH_C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy), SH_C3[4] * x * (4.0 * zz - xx - yy),
        SH_C3[5] * z * (xx - yy), SH_C3[6] * x * (xx - 3.0 * yy),
      );
    }
  }
}

// Storage of coefficients: SH_PRECISION of the renderer's pack/sh.ts.
const SH_FLOAT16 = 1u;

// Number of 8-byte words that hold the coefficients of one splat.
fn sh_stride(degree: u32, encoding: u32) -> u32 {
  if (encoding == SH_FLOAT16) { return (3u * (degree + 1u) * (degree + 1u) + 3u) / 4u; }
  // 1, 2, 4, 7 for degree 0 to 3.
  return 1u + degree * (degree + 1u) / 2u;
}

// Scale of the codes of a band of int8 coefficients.
fn sh_scale(code: u32) -> f32 {
  return select(0.0, exp2(f32(code) / 8.0 - 16.0), code != 0u);
}
