// Rasterizes tiles with the order of each pixel: by the densest depth of a splat along its ray (shared/pixel_depth).
// Splats come in the order of the tile's list. A pixel keeps a sorted window of the last splats that reach it, and
// blends the nearest ones when new ones push them out. The order is exact as long as no splat comes later than the
// window is long.
#import shared/scene_depth
#import shared/pixel_depth
#import shared/cull_stats
#import shared/whole_lists

@group(0) @binding(7) var<storage, read> pixel_depths: array<PixelDepth>;
@group(0) @binding(8) var<storage, read> cull_stats: array<u32>;
@group(0) @binding(9) var<uniform> scene: SceneDepth;
@group(0) @binding(10) var stored_depth: texture_2d<f32>;
// Receives the depth that halves the transmittance; 0 if more light passes.
@group(0) @binding(11) var median_depth: texture_storage_2d<r32float, write>;
@group(0) @binding(12) var layer_color: texture_2d<f32>;
@group(0) @binding(13) var second_depth: texture_2d<f32>;
@group(0) @binding(14) var second_color: texture_2d<f32>;

const SIDE: u32 = SMALL_TILE;
const COLUMN: u32 = 1u;

override tests_depth: bool = false;
override writes_depth: bool = false;
// True for parallel rays.
override is_parallel: bool = false;
// True for a window of 32 splats instead of 16.
override is_wide: bool = false;

struct Pixel {
  color: vec3f,
  transmittance: f32,
  // No splat may reduce the transmittance to this value, or none is blended behind it; FINISHED once it is reached, or
  // if the pixel has nothing to draw.
  min_transmittance: f32,
}
alias Pixels = Pixel;

// Larger than any transmittance.
const FINISHED = 2.0;

// 2 ln 2: converts to r² from u² + v² in the axes of a batch.
const RADIUS_2 = 1.3862943611198906;
// Least 1 / depth.
const NEARNESS_MIN = 1e-30;

// For the splats of the batch and the placeholder: 1 / depth (depth itself, if rays are parallel) at the corner of the
// tile, and its gradient across and down.
var<workgroup> nearness: array<f32, BATCH + 1u>;
var<workgroup> slopes: array<vec2f, BATCH + 1u>;

// First depth of the steps, as float32 bits, and the number of low bits that one step covers.
var<private> first_depth: u32;
var<private> step_bits: u32;
// Depth of the next layer, number of blended layers, and the texel of all of them.
var<private> limit: f32;
var<private> passed: u32;
var<private> own_texel: vec2u;
var<private> half_depth: f32;

// Four splats of a pixel. `key` has the depth in 20 bits above the alpha in 12, and is 0 for an empty place, so that it
// sorts first. `color` has three 9-bit mantissas with a shared exponent.
struct Four {
  key: vec4u,
  color: vec4u,
}

const ALPHA_BITS = 12u;
const ALPHA_MASK = (1u << ALPHA_BITS) - 1u;
const DEPTH_BITS = 20u;
const DEPTH_MASK = (1u << DEPTH_BITS) - 1u;

// The window, from near to far. The second half is used only by wide windows.
var<private> window_0: Four;
var<private> window_1: Four;
var<private> window_2: Four;
var<private> window_3: Four;
var<private> window_4: Four;
var<private> window_5: Four;
var<private> window_6: Four;
var<private> window_7: Four;

// Adding 2^23 to a smaller integer leaves it in the lowest bits of the float; conversions take a GPU four times as
// long.
const WHOLE = 8388608.0;
const WHOLE_BITS = 0x4b000000u;

fn whole(x: f32) -> u32 { return bitcast<u32>(x + WHOLE) & 0x7fffffu; }
fn number(bits: u32) -> f32 { return bitcast<f32>(bits | WHOLE_BITS) - WHOLE; }

fn shared_exponent(color: vec3f) -> u32 {
  let brightest = bitcast<u32>(max(max(color.r, color.g), max(color.b, 0x1p-16)));
  // Rounded first, so that 2^(exponent - 15) exceeds the largest channel.
  let exponent = ((brightest + 0x4000u) >> 23u) - 111u;
  let steps = color * bitcast<f32>((151u - exponent) << 23u);
  return whole(steps.r) | (whole(steps.g) << 9u) | (whole(steps.b) << 18u) | (exponent << 27u);
}

fn shared_exponent_color(bits: u32) -> vec3f {
  let steps = vec3f(number(bits & 511u), number((bits >> 9u) & 511u), number((bits >> 18u) & 511u));
  return steps * bitcast<f32>(((bits >> 27u) + 103u) << 23u);
}

// The color, and the bend of the splat's depth, in the axes of the batch.
fn packed_color(s: ProjectedSplat, slot: u32) -> vec2u {
  return vec2u(shared_exponent(splat_color(s)), bitcast<u32>(RADIUS_2 * pixel_depths[slot].bend));
}

fn load_more(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) {
  let d = pixel_depths[slot];
  slopes[k] = d.slope;
  nearness[k] = d.nearness - dot(d.slope, s.shape.xy - tile_corner);
}

fn start_pixels(pixel: vec2u) -> Pixel {
  if (any(vec2f(pixel) >= view.viewport)) { return Pixel(vec3f(0.0), 1.0, FINISHED); }
  let margin = MARGIN_OCTAVES << OCTAVE_BITS;
  first_depth = max(~cull_stats[NEAREST_INVERTED], margin) - margin;
  let range = max(cull_stats[FARTHEST] + margin, first_depth) - first_depth;
  step_bits = max(32u - min(countLeadingZeros(range), 32u), DEPTH_BITS) - DEPTH_BITS;
  if (tests_depth) {
    own_texel = scene_texel(vec2f(pixel) + 0.5);
    if (layers == 0u) { limit = limit_at(own_texel); } else { limit = layer_at(own_texel, 0u).depth; }
  }
  return Pixel(vec3f(0.0), 1.0, view.transmittance_min);
}

fn are_finished(pixel: Pixel) -> bool {
  return pixel.min_transmittance >= FINISHED;
}

fn depth_of(key: u32) -> f32 {
  return bitcast<f32>(first_depth + ((key >> ALPHA_BITS) << step_bits));
}

// Key and color of splat k of the batch at a pixel.
fn found_at(k: u32, place: vec2f, min_power: f32) -> vec2u {
  let axis = axes[k];
  let paint = paints[k];
  let u = axis.x * place.x + axis.y;
  let v = axis.z * place.x + (axis.w * place.y + bitcast<f32>(paint.x));
  let radius_2 = u * u + v * v;
  let power = bitcast<f32>(paint.y) - radius_2;
  let slope = slopes[k];
  let linear = nearness[k] + (slope.x * place.x + slope.y * place.y);
  var depth = max(linear, 0.0);
  // Behind the camera there is no densest point: the splat then surrounds the camera.
  if (!is_parallel) { depth = select(max(1.0 - bitcast<f32>(paint.w) * radius_2, 0.0) / max(linear, NEARNESS_MIN), 0.0, linear <= 0.0); }
  let steps = min((max(bitcast<u32>(depth), first_depth) - first_depth) >> step_bits, DEPTH_MASK);
  let alpha = min(ALPHA_MAX, exp2(power));
  let key = (steps << ALPHA_BITS) | whole(alpha * f32(ALPHA_MASK));
  let is_seen = power >= min_power && (!tests_depth || layers > 0u || depth <= limit);
  return vec2u(select(0u, key, is_seen), paint.z);
}

// Orders four pairs at once: the nearer splat of each goes into the first.
fn put_in_order(near: ptr<function, Four>, far: ptr<function, Four>) {
  let a = *near;
  let b = *far;
  let swaps = a.key > b.key;
  *near = Four(min(a.key, b.key), select(a.color, b.color, swaps));
  *far = Four(max(a.key, b.key), select(b.color, a.color, swaps));
}

// Sorts behind all others.
const LAST = Four(vec4u(0xffffffffu), vec4u(0u));

// Compares places 2 and 4, 3 and 5, 6 and 8, 7 and 9 of twelve.
fn order_two_apart(p: ptr<function, Four>, q: ptr<function, Four>, r: ptr<function, Four>) {
  var near = Four(vec4u((*p).key.zw, (*q).key.zw), vec4u((*p).color.zw, (*q).color.zw));
  var far = Four(vec4u((*q).key.xy, (*r).key.xy), vec4u((*q).color.xy, (*r).color.xy));
  put_in_order(&near, &far);
  *p = Four(vec4u((*p).key.xy, near.key.xy), vec4u((*p).color.xy, near.color.xy));
  *q = Four(vec4u(far.key.xy, near.key.zw), vec4u(far.color.xy, near.color.zw));
  *r = Four(vec4u(far.key.zw, (*r).key.zw), vec4u(far.color.zw, (*r).color.zw));
}

// Compares places 1 and 2, 3 and 4, 5 and 6, 7 and 8 of twelve.
fn order_neighbors(p: ptr<function, Four>, q: ptr<function, Four>, r: ptr<function, Four>) {
  var near = Four(vec4u((*p).key.yw, (*q).key.yw), vec4u((*p).color.yw, (*q).color.yw));
  var far = Four(
    vec4u((*p).key.z, (*q).key.xz, (*r).key.x), vec4u((*p).color.z, (*q).color.xz, (*r).color.x),
  );
  put_in_order(&near, &far);
  *p = Four(vec4u((*p).key.x, near.key.x, far.key.x, near.key.y), vec4u((*p).color.x, near.color.x, far.color.x, near.color.y));
  *q = Four(vec4u(far.key.y, near.key.z, far.key.z, near.key.w), vec4u(far.color.y, near.color.z, far.color.z, near.color.w));
  *r = Four(vec4u(far.key.w, (*r).key.yzw), vec4u(far.color.w, (*r).color.yzw));
}

// Sorts eight splats by Batcher's odd-even merge sort (1968): 19 comparisons.
fn sort_eight(p: ptr<function, Four>, q: ptr<function, Four>) {
  put_in_order(p, q);
  // Sorts pairs of pairs.
  var a = Four(
    vec4u((*p).key.x, (*q).key.x, (*p).key.z, (*q).key.z), vec4u((*p).color.x, (*q).color.x, (*p).color.z, (*q).color.z),
  );
  var b = Four(
    vec4u((*p).key.y, (*q).key.y, (*p).key.w, (*q).key.w), vec4u((*p).color.y, (*q).color.y, (*p).color.w, (*q).color.w),
  );
  put_in_order(&a, &b);
  // The first and the last of each four are final; the two between them are compared.
  var c = Four(vec4u(a.key.yw, 0u, 0u), vec4u(a.color.yw, 0u, 0u));
  var d = Four(vec4u(b.key.xz, 0u, 0u), vec4u(b.color.xz, 0u, 0u));
  put_in_order(&c, &d);
  *p = Four(vec4u(a.key.x, c.key.x, d.key.x, b.key.y), vec4u(a.color.x, c.color.x, d.color.x, b.color.y));
  *q = Four(vec4u(a.key.z, c.key.y, d.key.y, b.key.w), vec4u(a.color.z, c.color.y, d.color.y, b.color.w));
  put_in_order(p, q);
  var last = LAST;
  order_two_apart(p, q, &last);
  order_neighbors(p, q, &last);
}

// Merges eight sorted splats into sixteen sorted ones; the nearest eight are returned in order. An odd-even merge of 45
// comparisons, as if the eight were sixteen, half of them LAST.
fn merge_into(
  p: ptr<function, Four>, q: ptr<function, Four>,
  w: ptr<private, Four>, x: ptr<private, Four>, y: ptr<private, Four>, z: ptr<private, Four>,
) {
  var a = *w;
  var b = *x;
  var c = *y;
  var d = *z;
  var e = *p;
  var f = *q;
  put_in_order(&a, &e);
  put_in_order(&b, &f);
  put_in_order(&c, &e);
  put_in_order(&d, &f);
  put_in_order(&b, &c);
  put_in_order(&d, &e);
  var last = LAST;
  order_two_apart(&a, &b, &c);
  order_two_apart(&c, &d, &e);
  order_two_apart(&e, &f, &last);
  order_neighbors(&a, &b, &c);
  order_neighbors(&c, &d, &e);
  order_neighbors(&e, &f, &last);
  *p = a;
  *q = b;
  *w = c;
  *x = d;
  *y = e;
  *z = f;
}

fn blend_layer(pixel: ptr<function, Pixel>) {
  let layer = layer_at(own_texel, passed);
  passed++;
  limit = layer_at(own_texel, passed).depth;
  if (are_finished(*pixel)) { return; }
  (*pixel).color += (*pixel).transmittance * layer.color.rgb;
  (*pixel).transmittance *= 1.0 - layer.color.a;
  if ((*pixel).transmittance <= (*pixel).min_transmittance) { (*pixel).min_transmittance = FINISHED; }
}

fn blend_one(pixel: ptr<function, Pixel>, key: u32, color: u32) {
  if (tests_depth && layers > 0u) {
    while (depth_of(key) > limit) { blend_layer(pixel); }
  }
  let before = (*pixel).transmittance;
  let full_weight = before * (number(key & ALPHA_MASK) / f32(ALPHA_MASK));
  let remaining = before - full_weight;
  let ends = remaining <= (*pixel).min_transmittance;
  var refuses = ends;
  if (!refuses_last) { refuses = remaining <= REFUSED || are_finished(*pixel); }
  (*pixel).min_transmittance = select((*pixel).min_transmittance, FINISHED, ends);
  let after = select(remaining, before, refuses);
  if (writes_depth && before > 0.5 && after <= 0.5) { half_depth = depth_of(key); }
  (*pixel).color += select(full_weight, 0.0, refuses) * shared_exponent_color(color);
  (*pixel).transmittance = after;
}

fn blend_four(pixel: ptr<function, Pixel>, four: Four) {
  // Empty places sort before all others.
  if (four.key.w == 0u) { return; }
  blend_one(pixel, four.key.x, four.color.x);
  blend_one(pixel, four.key.y, four.color.y);
  blend_one(pixel, four.key.z, four.color.z);
  blend_one(pixel, four.key.w, four.color.w);
}

// Iterates over the splats of the batch that touch a block.
struct Walk {
  ahead: u32,
  next_word: u32,
}

fn find_next(walk: ptr<function, Walk>, own_block: u32) {
  while ((*walk).next_word < BATCH_WORDS) {
    if ((*walk).ahead != 0u) { break; }
    (*walk).ahead = atomicLoad(&block_hits[own_block * BATCH_WORDS + (*walk).next_word]);
    (*walk).next_word++;
  }
}

fn next_found(walk: ptr<function, Walk>, own_block: u32, place: vec2f, min_power: f32) -> vec2u {
  find_next(walk, own_block);
  let ahead = (*walk).ahead;
  let k = select(NO_SPLAT, ((*walk).next_word - 1u) * 32u + zeros_below(ahead), ahead != 0u);
  (*walk).ahead = ahead & (ahead - 1u);
  return found_at(k, place, min_power);
}

fn next_four(walk: ptr<function, Walk>, own_block: u32, place: vec2f, min_power: f32) -> Four {
  let a = next_found(walk, own_block, place, min_power);
  let b = next_found(walk, own_block, place, min_power);
  let c = next_found(walk, own_block, place, min_power);
  let d = next_found(walk, own_block, place, min_power);
  return Four(vec4u(a.x, b.x, c.x, d.x), vec4u(a.y, b.y, c.y, d.y));
}

fn paint_batch(pixel: ptr<function, Pixel>, own_block: u32, place: vec2f, min_power: f32) {
  var walk = Walk(0u, 0u);
  loop {
    find_next(&walk, own_block);
    if (walk.ahead == 0u || are_finished(*pixel)) { break; }
    var p = next_four(&walk, own_block, place, min_power);
    var q = next_four(&walk, own_block, place, min_power);
    sort_eight(&p, &q);
    // Splats leave the window sorted at its near end; new ones are inserted at their depth.
    merge_into(&p, &q, &window_0, &window_1, &window_2, &window_3);
    let leaving_p = p;
    let leaving_q = q;
    if (is_wide) {
      p = window_2;
      q = window_3;
      merge_into(&p, &q, &window_4, &window_5, &window_6, &window_7);
      window_2 = p;
      window_3 = q;
    }
    blend_four(pixel, leaving_p);
    blend_four(pixel, leaving_q);
  }
}

fn finish_pixels(pixel: ptr<function, Pixel>, position: vec2u) {
  if (any(vec2f(position) >= view.viewport)) { return; }
  blend_four(pixel, window_0);
  blend_four(pixel, window_1);
  blend_four(pixel, window_2);
  blend_four(pixel, window_3);
  if (is_wide) {
    blend_four(pixel, window_4);
    blend_four(pixel, window_5);
    blend_four(pixel, window_6);
    blend_four(pixel, window_7);
  }
  while (passed < layers) { blend_layer(pixel); }
  if (writes_depth) { textureStore(median_depth, position, vec4f(half_depth)); }
  store_pixel(position, (*pixel).color, (*pixel).transmittance);
}

fn aux_clear(lane: u32) {}
fn aux_store(k: u32) {}
