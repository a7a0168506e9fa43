// Evaluates one part of a clip at one frame: one thread for each row, and one workgroup for each chunk, whose bounds it
// computes. Each attribute differs from its base by a sum of curves that all splats share, weighted by the codes of the
// splat. Rows beyond the part, and splats that are absent from the frame, become transparent.
#import shared/sh
#import shared/turn_harmonics
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
  // 1 if harmonics turn with the change of rotation.
  turns_harmonics: u32,
  // Number of the last curves of each attribute whose frames count from the first frame of each splat.
  aged: vec4u,
  color_aged: u32,
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

// The curves of an attribute: the first one, their number, and the number of the last of them that run in the age.
struct Curves {
  first: u32,
  rank: u32,
  aged: u32,
}

// The change of one number, whose codes lie in the planes from `plane` on.
fn change(plane: u32, own: Curves, row: u32, age: u32) -> f32 {
  var sum = 0.0;
  let in_frames = animate.frame * animate.curve_count + own.first;
  let in_ages = age * animate.curve_count + own.first;
  let aged_from = own.rank - own.aged;
  for (var k = 0u; k < aged_from; k++) { sum += curves[in_frames + k] * code(plane + k, row); }
  for (var k = aged_from; k < own.rank; k++) { sum += curves[in_ages + k] * code(plane + k, row); }
  return sum;
}

fn change_of_three(plane: u32, own: Curves, row: u32, age: u32) -> vec3f {
  return vec3f(
    change(plane, own, row, age), change(plane + own.rank, own, row, age), change(plane + 2u * own.rank, own, row, age),
  );
}

// The quaternion of a rotation vector, whose length is the angle in radians.
fn quaternion_of(turn: vec3f) -> vec4f {
  let angle = length(turn);
  let s = select(0.5, sin(0.5 * angle) / angle, angle > 1e-6);
  return vec4f(s * turn, cos(0.5 * angle));
}

fn turned(q: vec4f, turn: vec4f) -> vec4f {
  return vec4f(turn.w * q.xyz + q.w * turn.xyz + cross(turn.xyz, q.xyz), turn.w * q.w - dot(turn.xyz, q.xyz));
}

fn write_color(row: u32, to: u32, change: vec3f) {
  let words = sh_stride(animate.sh_degree, SH_FLOAT16);
  var first = base_sh[row * words];
  let red_green = unpack2x16float(first.x) + change.xy;
  let blue_next = unpack2x16float(first.y) + vec2f(change.z, 0.0);
  sh[to * words] = vec2u(pack2x16float(red_green), pack2x16float(blue_next));
  for (var k = 1u; k < words; k++) { sh[to * words + k] = base_sh[row * words + k]; }
}

// As write_color, with harmonics that turn.
fn write_turned_color(row: u32, to: u32, change: vec3f, turn: vec4f) {
  let words = sh_stride(animate.sh_degree, SH_FLOAT16);
  // Halves in the order [coefficient][channel].
  var values: array<f32, 48>;
  for (var k = 0u; k < words; k++) {
    let word = base_sh[row * words + k];
    let low = unpack2x16float(word.x);
    let high = unpack2x16float(word.y);
    values[4u * k] = low.x;
    values[4u * k + 1u] = low.y;
    values[4u * k + 2u] = high.x;
    values[4u * k + 3u] = high.y;
  }
  for (var c = 0u; c < 3u; c++) { values[c] += change[c]; }
  let angles = angles_of(turn);
  var first = 1u;
  for (var l = 1u; l <= animate.sh_degree; l++) {
    var band: array<vec3f, 7>;
    let size = 2u * l + 1u;
    for (var k = 0u; k < size; k++) {
      let at = 3u * (first + k);
      band[k] = vec3f(values[at], values[at + 1u], values[at + 2u]);
    }
    turn_band(&band, l, angles);
    for (var k = 0u; k < size; k++) {
      let at = 3u * (first + k);
      for (var c = 0u; c < 3u; c++) { values[at + c] = band[k][c]; }
    }
    first += size;
  }
  for (var k = 0u; k < words; k++) {
    let at = 4u * k;
    sh[to * words + k] = vec2u(
      pack2x16float(vec2f(values[at], values[at + 1u])), pack2x16float(vec2f(values[at + 2u], values[at + 3u])),
    );
  }
}

fn animate_row(row: u32, to: u32, lane: u32) -> PackedGaussian {
  let base = bases[row];
  let begin = base.life & 0xffffu;
  let end = base.life >> 16u;
  if (animate.frame < begin || animate.frame >= end) { return unseen_gaussian(); }
  let age = animate.frame - begin;
  let ranks = animate.ranks;
  let aged = animate.aged;
  let planes = vec4u(3u, 3u, 3u, 1u) * ranks;
  var plane = 0u;
  var curve = 0u;
  let position = base.position + change_of_three(plane, Curves(curve, ranks.x, aged.x), row, age);
  plane += planes.x;
  curve += ranks.x;
  let turn = quaternion_of(change_of_three(plane, Curves(curve, ranks.y, aged.y), row, age));
  let rotation = turned(base.rotation, turn);
  plane += planes.y;
  curve += ranks.y;
  let growth = change_of_three(plane, Curves(curve, ranks.z, aged.z), row, age);
  let scales = animate.grow * base.scales * exp(clamp(growth, vec3f(-40.0), vec3f(40.0)));
  plane += planes.z;
  curve += ranks.z;
  let color_plane = plane + planes.w;
  let fade_plane = color_plane + 3u * animate.color_rank;
  let shown = min(fade(fade_plane, row, age), fade(fade_plane + 1u, row, end - 1u - animate.frame));
  let own_opacity = change(plane, Curves(curve, ranks.w, aged.w), row, age);
  let opacity = clamp(base.opacity * min(1.0, shown) + own_opacity, 0.0, 1.0);
  let color = change_of_three(color_plane, Curves(curve + ranks.w, animate.color_rank, animate.color_aged), row, age);
  if (animate.turns_harmonics == 1u && ranks.y > 0u && animate.sh_degree > 0u) {
    write_turned_color(row, to, color, turn);
  } else {
    write_color(row, to, color);
  }
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
