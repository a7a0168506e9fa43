// Packs Gaussians that are computed on the GPU, and finds the bounds of each workgroup of them, which is a chunk.
#import shared/packed_gaussian
#import shared/falloff
#import shared/chunk

// Larger than any drawable coordinate, because WGSL has no infinity.
const BEYOND = 1e30;

// Lower triangular root of a covariance, Σ = L Lᵀ.
struct Factor {
  // xx, yx, zx; yy, zy; zz
  x: vec3f,
  y: vec2f,
  z: f32,
  usable: bool,
}

fn no_factor() -> Factor {
  return Factor(vec3f(0.0), vec2f(0.0), 0.0, false);
}

fn ratio(a: f32, b: f32) -> f32 {
  if (b > 0.0) { return a / b; }
  return 0.0;
}

// Orthogonalizes the rows of R S one after the other, as pack/factor.ts of the renderer does, so that needles keep the
// digits that a covariance would lose. `q` is x, y, z, w, of any length but 0.
fn factor_of(quaternion: vec4f, scales: vec3f) -> Factor {
  var q = quaternion;
  // Divided by the largest first, because squares of tiny or huge components would leave the range of float32.
  let largest = max(max(abs(q.x), abs(q.y)), max(abs(q.z), abs(q.w)));
  if (largest <= 0.0) { return no_factor(); }
  q /= largest;
  q /= sqrt(dot(q, q));
  let twice = 2.0 * q.xyz;
  let a = vec3f(1.0 - twice.y * q.y - twice.z * q.z, twice.x * q.y - twice.z * q.w, twice.x * q.z + twice.y * q.w) * scales;
  var b = vec3f(twice.x * q.y + twice.z * q.w, 1.0 - twice.x * q.x - twice.z * q.z, twice.y * q.z - twice.x * q.w) * scales;
  var c = vec3f(twice.x * q.z - twice.y * q.w, twice.y * q.z + twice.x * q.w, 1.0 - twice.x * q.x - twice.y * q.y) * scales;
  let xx = length(a);
  // A row of length 0 is orthogonal to everything.
  let x = vec3f(ratio(a.x, xx), ratio(a.y, xx), ratio(a.z, xx));
  let yx = dot(x, b);
  let zx = dot(x, c);
  b -= yx * x;
  c -= zx * x;
  let yy = length(b);
  let y = vec3f(ratio(b.x, yy), ratio(b.y, yy), ratio(b.z, yy));
  let zy = dot(y, c);
  return Factor(vec3f(xx, yx, zx), vec2f(yy, zy), length(c - zy * y), true);
}

// Rounds to the highest 22 bits of a float32, which PackedGaussian keeps.
fn high_22(value: f32) -> u32 { return (bitcast<u32>(value) + 0x200u) >> 10u; }

// Rounds to 28 bits, on the same side of 1/255 as the opacity, because splats below it are not drawn.
fn high_28(opacity: f32) -> u32 {
  let first_visible = (bitcast<u32>(ALPHA_MIN) + 15u) >> 4u;
  let nearest = (bitcast<u32>(opacity) + 8u) >> 4u;
  return select(min(nearest, first_visible - 1u), max(nearest, first_visible), opacity >= ALPHA_MIN);
}

fn pack_gaussian(position: vec3u, f: Factor, opacity: f32) -> PackedGaussian {
  let last = high_22(f.z);
  let visible = high_28(opacity);
  return PackedGaussian(
    vec4u(position, (high_22(f.x.x) << 10u) | (last >> 12u)),
    vec4u(
      (high_22(f.x.y) << 10u) | ((last >> 2u) & 0x3ffu),
      (high_22(f.y.x) << 10u) | ((last & 3u) << 8u) | (visible >> 20u),
      (high_22(f.x.z) << 10u) | ((visible >> 10u) & 0x3ffu),
      (high_22(f.y.y) << 10u) | (visible & 0x3ffu),
    ),
  );
}

// A valid Gaussian with extent 1 and opacity 0, which is not drawn.
fn unseen_gaussian() -> PackedGaussian {
  return PackedGaussian(vec4u(0u, 0u, 0u, bitcast<u32>(1.0)), vec4u(0u));
}

// Lowest corner and minus the reach; highest corner.
var<workgroup> lows: array<vec4f, CULL_GROUP>;
var<workgroup> highs: array<vec3f, CULL_GROUP>;

fn note_nothing(lane: u32) {
  lows[lane] = vec4f(vec3f(BEYOND), 0.0);
  highs[lane] = vec3f(-BEYOND);
}

fn note_reach(lane: u32, center: vec3f, factor: Factor, opacity: f32) {
  // No axis is longer than the norm of the factor. The margin covers the rounding of packing.
  let longest = 1.001 * length(vec3f(length(factor.x), length(factor.y), factor.z));
  let reach = longest * sqrt(2.0 * log(max(opacity / ALPHA_MIN, 1.0)));
  lows[lane] = vec4f(center, -reach);
  highs[lane] = center;
}

// Bounds of all lanes, for lane 0. A chunk without splats is an inverted box, which is always culled.
fn chunk_of_group(lane: u32) -> Chunk {
  workgroupBarrier();
  for (var half = CULL_GROUP / 2u; half > 0u; half /= 2u) {
    if (lane < half) {
      lows[lane] = min(lows[lane], lows[lane + half]);
      highs[lane] = max(highs[lane], highs[lane + half]);
    }
    workgroupBarrier();
  }
  return Chunk(lows[0].xyz, -lows[0].w, highs[0], 0.0);
}
