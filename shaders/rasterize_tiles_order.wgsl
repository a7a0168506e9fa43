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
// True if a splat of the window is its key alone, for large images and windows of 16: a comparison is then a minimum and
// a maximum, and alpha and color are found again when the splat is blended.
override has_keys: bool = false;

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
const FLOAT16_MAX = 65504.0;
// Least 1 / depth.
const NEARNESS_MIN = 1e-30;

// For the splats of the batch and the placeholder: 1 / depth (depth itself, if rays are parallel) at the corner of the
// tile, and its gradient across and down.
var<workgroup> nearness: array<f32, BATCH + 1u>;
var<workgroup> slopes: array<vec2f, BATCH + 1u>;

// First and last depth of the steps, as float32 bits, and how many bits keys shift them to the left.
var<private> first_depth: u32;
var<private> last_depth: u32;
var<private> shift: u32;
// Depth of the next layer, number of blended layers, and the texel of all of them.
var<private> limit: f32;
var<private> passed: u32;
var<private> own_texel: vec2u;
var<private> half_depth: f32;

// Four splats of a pixel. `key` has the depth in 20 bits above the alpha in 12, and is 0 for an empty place, so that it
// sorts first. `color` has three 9-bit mantissas with a shared exponent. With `has_keys`, the depth has 23 bits above the
// place in 9: NO_SPLAT - k for splat k of the batch, and NO_SPLAT + 1 + k for splat k of `carried`; `color` is 0.
struct Four {
  key: vec4u,
  color: vec4u,
}

const ALPHA_BITS = 12u;
const ALPHA_MASK = (1u << ALPHA_BITS) - 1u;
const PLACE_MASK = 511u;

// The window, from near to far. The second half is used only by wide windows.
var<private> window_0: Four;
var<private> window_1: Four;
var<private> window_2: Four;
var<private> window_3: Four;
var<private> window_4: Four;
var<private> window_5: Four;
var<private> window_6: Four;
var<private> window_7: Four;

// The splats of the window that are of earlier batches, with `has_keys`: red and green in float16, then blue in float16
// below alpha in 65,535ths.
var<private> carried: array<vec2u, 16>;

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

// The color, and the bend of the splat's depth, in the axes of the batch. With `has_keys` all in float16, blue and bend
// in one word.
fn packed_color(s: ProjectedSplat, slot: u32) -> vec2u {
  let bend = RADIUS_2 * pixel_depths[slot].bend;
  if (has_keys) { return vec2u(s.paint.y, pack2x16float(vec2f(splat_color(s).b, min(bend, FLOAT16_MAX)))); }
  return vec2u(shared_exponent(splat_color(s)), bitcast<u32>(bend));
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
  last_depth = max(cull_stats[FARTHEST] + margin, first_depth);
  shift = min(countLeadingZeros(last_depth - first_depth), 31u);
  if (tests_depth) {
    own_texel = scene_texel(vec2f(pixel) + 0.5);
    if (layers == 0u) { limit = limit_at(own_texel); } else { limit = layer_at(own_texel, 0u).depth; }
  }
  return Pixel(vec3f(0.0), 1.0, view.transmittance_min);
}

fn are_finished(pixel: Pixel) -> bool {
  return pixel.min_transmittance >= FINISHED;
}

// Bits of a key above its alpha or place.
fn depth_mask() -> u32 { return ~select(ALPHA_MASK, PLACE_MASK, has_keys); }

fn depth_of(key: u32) -> f32 {
  return bitcast<f32>(first_depth + ((key & depth_mask()) >> shift));
}

// Key and color of splat k of the batch at a pixel.
fn found_at(k: u32, place: vec2f, min_power: f32) -> vec2u {
  let axis = axes[k];
  let paint = paints[k];
  let u = axis.x * place.x + axis.y;
  let v = axis.z * place.x + (axis.w * place.y + bitcast<f32>(paint.x));
  let radius_2 = u * u + v * v;
  let power = bitcast<f32>(paint.y) - radius_2;
  let bend = select(bitcast<f32>(paint.w), unpack2x16float(paint.w).y, has_keys);
  let slope = slopes[k];
  let linear = nearness[k] + (slope.x * place.x + slope.y * place.y);
  var depth = max(linear, 0.0);
  // Behind the camera there is no densest point: the splat then surrounds the camera.
  if (!is_parallel) { depth = select(max(1.0 - bend * radius_2, 0.0) / max(linear, NEARNESS_MIN), 0.0, linear <= 0.0); }
  let steps = ((clamp(bitcast<u32>(depth), first_depth, last_depth) - first_depth) << shift) & depth_mask();
  let is_seen = power >= min_power && (!tests_depth || layers > 0u || depth <= limit);
  if (has_keys) { return vec2u(select(0u, steps | (NO_SPLAT - k), is_seen), 0u); }
  let alpha = min(ALPHA_MAX, exp2(power));
  return vec2u(select(0u, steps | whole(alpha * f32(ALPHA_MASK)), is_seen), paint.z);
}

// Alpha and color of splat k of the batch at a pixel.
fn splat_at(k: u32, place: vec2f) -> vec4f {
  let axis = axes[k];
  let paint = paints[k];
  let u = axis.x * place.x + axis.y;
  let v = axis.z * place.x + (axis.w * place.y + bitcast<f32>(paint.x));
  let alpha = min(ALPHA_MAX, exp2(bitcast<f32>(paint.y) - (u * u + v * v)));
  return vec4f(alpha, unpack2x16float(paint.z), unpack2x16float(paint.w).x);
}

// Alpha and color of a splat of the window.
fn splat_of(key: u32, color: u32, place: vec2f) -> vec4f {
  if (!has_keys) { return vec4f(number(key & ALPHA_MASK) / f32(ALPHA_MASK), shared_exponent_color(color)); }
  let own = key & PLACE_MASK;
  if (own <= NO_SPLAT) { return splat_at(NO_SPLAT - own, place); }
  let words = carried[own - NO_SPLAT - 1u];
  return vec4f(f32(words.y >> 16u) / 65535.0, unpack2x16float(words.x), unpack2x16float(words.y).x);
}

// The two words of a splat of the window that the next batch carries.
fn to_carry(key: u32, place: vec2f) -> vec2u {
  let own = key & PLACE_MASK;
  if (own > NO_SPLAT) { return carried[own - NO_SPLAT - 1u]; }
  let k = NO_SPLAT - own;
  return vec2u(paints[k].z, (paints[k].w & 0xffffu) | (u32(splat_at(k, place).x * 65535.0 + 0.5) << 16u));
}

fn four_to_carry(four: Four, place: vec2f) -> array<vec2u, 4> {
  return array<vec2u, 4>(
    to_carry(four.key.x, place), to_carry(four.key.y, place), to_carry(four.key.z, place), to_carry(four.key.w, place),
  );
}

// Carries four splats as numbers `first` to `first` + 3 of the window.
fn carry_four(four: ptr<private, Four>, words: array<vec2u, 4>, first: u32) {
  carried[first] = words[0];
  carried[first + 1u] = words[1];
  carried[first + 2u] = words[2];
  carried[first + 3u] = words[3];
  let key = (*four).key;
  let places = vec4u(NO_SPLAT + 1u + first) + vec4u(0u, 1u, 2u, 3u);
  (*four).key = select(vec4u(0u), (key & vec4u(~PLACE_MASK)) | places, key > vec4u(0u));
}

fn carry_pixels(pixel: ptr<function, Pixel>, place: vec2f) {
  if (!has_keys || are_finished(*pixel)) { return; }
  // All are read before any is replaced.
  let a = four_to_carry(window_0, place);
  let b = four_to_carry(window_1, place);
  let c = four_to_carry(window_2, place);
  let d = four_to_carry(window_3, place);
  carry_four(&window_0, a, 0u);
  carry_four(&window_1, b, 4u);
  carry_four(&window_2, c, 8u);
  carry_four(&window_3, d, 12u);
}

// No color with `has_keys`, so that compilers drop what would move it.
fn with_color(key: vec4u, color: vec4u) -> Four {
  if (has_keys) { return Four(key, vec4u(0u)); }
  return Four(key, color);
}

// Orders four pairs at once: the nearer splat of each goes into the first.
fn put_in_order(near: ptr<function, Four>, far: ptr<function, Four>) {
  let a = *near;
  let b = *far;
  let swaps = a.key > b.key;
  *near = with_color(min(a.key, b.key), select(a.color, b.color, swaps));
  *far = with_color(max(a.key, b.key), select(b.color, a.color, swaps));
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
  *w = with_color(c.key, c.color);
  *x = with_color(d.key, d.color);
  *y = with_color(e.key, e.color);
  *z = with_color(f.key, f.color);
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

// `splat`: its alpha and color.
fn blend_one(pixel: ptr<function, Pixel>, key: u32, splat: vec4f) {
  if (tests_depth && layers > 0u) {
    while (depth_of(key) > limit) { blend_layer(pixel); }
  }
  let before = (*pixel).transmittance;
  let full_weight = before * splat.x;
  let remaining = before - full_weight;
  let ends = remaining <= (*pixel).min_transmittance;
  var refuses = ends;
  if (!refuses_last) { refuses = remaining <= REFUSED || are_finished(*pixel); }
  (*pixel).min_transmittance = select((*pixel).min_transmittance, FINISHED, ends);
  let after = select(remaining, before, refuses);
  if (writes_depth && before > 0.5 && after <= 0.5) { half_depth = depth_of(key); }
  (*pixel).color += select(full_weight, 0.0, refuses) * splat.yzw;
  (*pixel).transmittance = after;
}

fn blend_four(pixel: ptr<function, Pixel>, four: Four, place: vec2f) {
  // Empty places sort before all others.
  if (four.key.w == 0u) { return; }
  let places = four.key & vec4u(PLACE_MASK);
  if (has_keys && all(places <= vec4u(NO_SPLAT))) {
    let k = vec4u(NO_SPLAT) - places;
    blend_one(pixel, four.key.x, splat_at(k.x, place));
    blend_one(pixel, four.key.y, splat_at(k.y, place));
    blend_one(pixel, four.key.z, splat_at(k.z, place));
    blend_one(pixel, four.key.w, splat_at(k.w, place));
    return;
  }
  blend_one(pixel, four.key.x, splat_of(four.key.x, four.color.x, place));
  blend_one(pixel, four.key.y, splat_of(four.key.y, four.color.y, place));
  blend_one(pixel, four.key.z, splat_of(four.key.z, four.color.z, place));
  blend_one(pixel, four.key.w, splat_of(four.key.w, four.color.w, place));
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
    blend_four(pixel, leaving_p, place);
    blend_four(pixel, leaving_q, place);
  }
}

fn finish_pixels(pixel: ptr<function, Pixel>, position: vec2u) {
  if (any(vec2f(position) >= view.viewport)) { return; }
  let place = vec2f(position % view.tile_side) + 0.5;
  blend_four(pixel, window_0, place);
  blend_four(pixel, window_1, place);
  blend_four(pixel, window_2, place);
  blend_four(pixel, window_3, place);
  if (is_wide) {
    blend_four(pixel, window_4, place);
    blend_four(pixel, window_5, place);
    blend_four(pixel, window_6, place);
    blend_four(pixel, window_7, place);
  }
  while (passed < layers) { blend_layer(pixel); }
  if (writes_depth) { textureStore(median_depth, position, vec4f(half_depth)); }
  store_pixel(position, (*pixel).color, (*pixel).transmittance);
}

fn aux_clear(lane: u32) {}
fn aux_store(k: u32) {}
