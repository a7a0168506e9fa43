// Evaluates one part of a clip at one frame: one thread for each row, and one workgroup for each chunk, whose bounds it
// computes. Each attribute differs from its base by a sum of curves that all splats share, weighted by the codes of the
// splat. Rows beyond the part, and splats that are absent from the frame, become transparent.
#import shared/sh
#import shared/written_gaussian
#import shared/group

struct Animate {
  // Curves of positions, rotations, scales and opacities.
  ranks: vec4u,
  color_rank: u32,
  // Curves of all attributes together: the length of a row of `curves`.
  curve_count: u32,
  // Index of the frame within the group.
  frame: u32,
  // Splats of the part, and the rows that are written from `first_row` on, a multiple of CULL_GROUP.
  rows: u32,
  row_room: u32,
  first_row: u32,
  // Codes of a plane: `rows`, rounded up to an even number.
  plane_codes: u32,
  sh_degree: u32,
  // Factor of all scales.
  grow: f32,
}

// The base of a splat: its attributes before motion.
struct Base {
  position: vec3f,
  // Lower half: the first frame that contains the splat. Upper half: the frame after its last.
  life: u32,
  scales: vec3f,
  opacity: f32,
  // x, y, z, w
  rotation: vec4f,
}

@group(0) @binding(0) var<uniform> animate: Animate;
@group(0) @binding(1) var<storage, read> bases: array<Base>;
@group(0) @binding(2) var<storage, read> base_sh: array<vec2u>;
// Two 16-bit codes in each word, plane by plane. The last two planes are fades: of appearing, then of disappearing;
// the lower byte is the fraction of the opacity in the first or last frame, the upper byte its change per frame, both in
// 255ths.
@group(0) @binding(3) var<storage, read> codes: array<u32>;
// [frames, curve_count], multiplied by the quantization steps of the codes.
@group(0) @binding(4) var<storage, read> curves: array<f32>;
@group(0) @binding(5) var<storage, read_write> gaussians: array<PackedGaussian>;
@group(0) @binding(6) var<storage, read_write> sh: array<vec2u>;
@group(0) @binding(7) var<storage, read_write> chunks: array<Chunk>;

// The code in the upper half.
fn code_bits(plane: u32, row: u32) -> u32 {
  let at = plane * animate.plane_codes + row;
  return codes[at / 2u] << (16u * (1u - (at & 1u)));
}

fn code(plane: u32, row: u32) -> f32 {
  // The shift extends the sign.
  return f32(bitcast<i32>(code_bits(plane, row)) >> 16u);
}

// Fraction of the opacity; `age` counts frames from the first or from the last one.
fn fade(plane: u32, row: u32, age: u32) -> f32 {
  let bits = code_bits(plane, row);
  return f32(((bits >> 16u) & 0xffu) + (bits >> 24u) * age) / 255.0;
}

// The change of one number: its codes lie in the planes from `plane` on, its curves start at `curve`.
fn change(plane: u32, curve: u32, rank: u32, row: u32) -> f32 {
  var sum = 0.0;
  let first = animate.frame * animate.curve_count + curve;
  for (var k = 0u; k < rank; k++) { sum += curves[first + k] * code(plane + k, row); }
  return sum;
}

fn change_of_three(plane: u32, curve: u32, rank: u32, row: u32) -> vec3f {
  return vec3f(
    change(plane, curve, rank, row), change(plane + rank, curve, rank, row), change(plane + 2u * rank, curve, rank, row),
  );
}

// Rotates a quaternion further; the length of `turn` is the angle in radians.
fn turned(q: vec4f, turn: vec3f) -> vec4f {
  let angle = length(turn);
  let s = select(0.5, sin(0.5 * angle) / angle, angle > 1e-6);
  let v = s * turn;
  let w = cos(0.5 * angle);
  return vec4f(w * q.xyz + q.w * v + cross(v, q.xyz), w * q.w - dot(v, q.xyz));
}

fn write_color(row: u32, to: u32, change: vec3f) {
  let words = sh_stride(animate.sh_degree, SH_FLOAT16);
  var first = base_sh[row * words];
  let red_green = unpack2x16float(first.x) + change.xy;
  let blue_next = unpack2x16float(first.y) + vec2f(change.z, 0.0);
  sh[to * words] = vec2u(pack2x16float(red_green), pack2x16float(blue_next));
  for (var k = 1u; k < words; k++) { sh[to * words + k] = base_sh[row * words + k]; }
}

fn animate_row(row: u32, to: u32, lane: u32) -> PackedGaussian {
  let base = bases[row];
  if (animate.frame < (base.life & 0xffffu) || animate.frame >= base.life >> 16u) { return unseen_gaussian(); }
  let ranks = animate.ranks;
  let planes = vec4u(3u, 3u, 3u, 1u) * ranks;
  var plane = 0u;
  var curve = 0u;
  let position = base.position + change_of_three(plane, curve, ranks.x, row);
  plane += planes.x;
  curve += ranks.x;
  let rotation = turned(base.rotation, change_of_three(plane, curve, ranks.y, row));
  plane += planes.y;
  curve += ranks.y;
  let scales = animate.grow * base.scales * exp(clamp(change_of_three(plane, curve, ranks.z, row), vec3f(-40.0), vec3f(40.0)));
  plane += planes.z;
  curve += ranks.z;
  let color_plane = plane + planes.w;
  let fade_plane = color_plane + 3u * animate.color_rank;
  let first = base.life & 0xffffu;
  let last = (base.life >> 16u) - 1u;
  let shown = min(fade(fade_plane, row, animate.frame - first), fade(fade_plane + 1u, row, last - animate.frame));
  let opacity = clamp(base.opacity * min(1.0, shown) + change(plane, curve, ranks.w, row), 0.0, 1.0);
  write_color(row, to, change_of_three(color_plane, curve + ranks.w, animate.color_rank, row));
  let factor = factor_of(rotation, scales);
  let packed = pack_gaussian(bitcast<vec3u>(position), factor, opacity);
  if (!is_usable(packed)) { return unseen_gaussian(); }
  note_reach(lane, position, factor, opacity);
  return packed;
}

@compute @workgroup_size(CULL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let chunk = group_index(workgroup_id);
  let row = chunk * CULL_GROUP + lane;
  let to = animate.first_row + row;
  note_nothing(lane);
  if (row < animate.rows) {
    gaussians[to] = animate_row(row, to, lane);
  } else if (row < animate.row_room) {
    gaussians[to] = unseen_gaussian();
  }
  let bounds = chunk_of_group(lane);
  if (lane == 0u && chunk * CULL_GROUP < animate.row_room) { chunks[animate.first_row / CULL_GROUP + chunk] = bounds; }
}
