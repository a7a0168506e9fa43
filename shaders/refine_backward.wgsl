// Backpropagates from the pixels of an image to the splats that were drawn: the derivatives of the squared error
// against a reference by the colors and ellipses of the splats. One workgroup for each patch of 16 x 16 pixels of a
// tile and one thread for each pixel, front to back as in the forward pass: the color behind a splat is the finished
// color minus the accumulated one, so nothing is stored. Derivatives are summed in fixed point, over the pixels of a
// patch and then over the patches, so the sums do not depend on the order, and no thread waits or retries.
#import shared/tile_list
#import shared/refined

// Premultiplied red, green, blue and alpha.
@group(0) @binding(5) var image: texture_2d<f32>;
@group(0) @binding(6) var reference: texture_2d<f32>;
// SCREEN_NUMBERS of each splat, two words each: see `of_fixed`.
@group(0) @binding(7) var<storage, read_write> screen: array<atomic<i32>>;
// Indices of the splats by slot.
@group(0) @binding(8) var<storage, read> survivors: array<u32>;

// Side of a patch in pixels.
const PATCH = 16u;
// Splats in each batch.
const BACKWARD_BATCH = 128u;
// Clamp of the difference of a channel, so that outliers do not dominate.
const MAX_DIFFERENCE = 0.0625;
// Clamp of one pixel's number of steps: 256 of them fit an i32.
const MAX_FIXED = 8388607.0;

var<workgroup> slots: array<u32, BACKWARD_BATCH>;
var<workgroup> shapes: array<vec4f, BACKWARD_BATCH>;
var<workgroup> paints: array<vec4u, BACKWARD_BATCH>;
var<workgroup> sums: array<atomic<i32>, BACKWARD_BATCH * SCREEN_NUMBERS>;
var<workgroup> unfinished: atomic<u32>;
var<workgroup> is_open: u32;

fn add_fixed(k: u32, number: u32, value: f32) {
  atomicAdd(&sums[k * SCREEN_NUMBERS + number], i32(clamp(round(value * FIXED), -MAX_FIXED, MAX_FIXED)));
}

// Adds the sum of a patch; at most 65,536 of them fit.
fn add_words(at: u32, sum: i32) {
  atomicAdd(&screen[2u * at], sum & 0xffff);
  atomicAdd(&screen[2u * at + 1u], sum >> 16u);
}

struct Pixel {
  place: vec2f,
  // Derivative of the squared error by each channel.
  slope: vec3f,
  // Color that is not yet drawn.
  behind: vec3f,
  transmittance: f32,
  is_finished: bool,
}

fn load_splat(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) {
  slots[k] = slot;
  shapes[k] = s.shape;
  paints[k] = s.paint;
}

// Same as `blend` of paint_columns, and also adds the pixel's derivatives for splat k of the batch.
fn unblend(pixel: ptr<function, Pixel>, k: u32) {
  let shape = shapes[k];
  let offset = (*pixel).place - shape.xy;
  let u = offset.x * shape.z;
  let v = (offset.y - shape.w * offset.x) * bitcast<f32>(paints[k].x);
  let own = bitcast<f32>(paints[k].w) * exp(-0.5 * (u * u + v * v));
  if (own < ALPHA_MIN) { return; }
  let alpha = min(ALPHA_MAX, own);
  let before = (*pixel).transmittance;
  let weight = before * alpha;
  if (before - weight <= view.transmittance_min) {
    (*pixel).is_finished = true;
    return;
  }
  let color = vec3f(unpack2x16float(paints[k].y), unpack2x16float(paints[k].z).x);
  (*pixel).transmittance = before - weight;
  (*pixel).behind -= weight * color;
  let by_color = weight * (*pixel).slope;
  add_fixed(k, 0u, by_color.x);
  add_fixed(k, 1u, by_color.y);
  add_fixed(k, 2u, by_color.z);
  add_fixed(k, 9u, BEND_UNIT * weight * weight);
  // The clamp of alpha has no derivative.
  if (own > ALPHA_MAX) { return; }
  let by_alpha = alpha * (before * color - (*pixel).behind / (1.0 - alpha));
  let q = dot((*pixel).slope, by_alpha);
  add_fixed(k, 3u, q);
  add_fixed(k, 4u, q * u);
  add_fixed(k, 5u, q * v);
  add_fixed(k, 6u, q * u * u);
  add_fixed(k, 7u, q * u * v);
  add_fixed(k, 8u, q * v * v);
  let bend = BEND_UNIT * dot(by_alpha, by_alpha);
  let square = u * u + v * v;
  add_fixed(k, 10u, bend);
  add_fixed(k, 11u, bend * square * square);
}

@compute @workgroup_size(TILE_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let corner = workgroup_id.xy * PATCH;
  let position = corner + vec2u(lane % PATCH, lane / PATCH);
  let tile = corner / view.tile_side;
  let bin = tile / vec2u(BIN_COLUMNS, BIN_ROWS);
  let in_bin = tile % vec2u(BIN_COLUMNS, BIN_ROWS);
  let tile_in_bin = in_bin.y * BIN_COLUMNS + in_bin.x;

  var pixel = Pixel(vec2f(position) + 0.5, vec3f(0.0), vec3f(0.0), 1.0, true);
  if (all(position < textureDimensions(reference))) {
    let expected = textureLoad(reference, position, 0);
    let painted = textureLoad(image, position, 0).xyz;
    pixel.is_finished = expected.w == 0.0;
    pixel.slope = 2.0 * clamp(painted - expected.xyz, vec3f(-MAX_DIFFERENCE), vec3f(MAX_DIFFERENCE));
    pixel.behind = painted;
  }
  var list = begin_list(bin.y * view.bins.x + bin.x, tile_in_bin, 0u);
  loop {
    if (lane == 0u) { atomicStore(&unfinished, 0u); }
    for (var k = lane; k < BACKWARD_BATCH * SCREEN_NUMBERS; k += TILE_THREADS) { atomicStore(&sums[k], 0); }
    let count = load_batch(&list, BACKWARD_BATCH, vec2f(corner), lane);
    if (count == 0u) { break; }
    workgroupBarrier();
    for (var k = 0u; k < count; k++) {
      if (pixel.is_finished) { break; }
      unblend(&pixel, k);
    }
    if (!pixel.is_finished) { atomicStore(&unfinished, 1u); }
    workgroupBarrier();
    if (lane < count) {
      let at = SCREEN_NUMBERS * survivors[slots[lane]];
      for (var number = 0u; number < SCREEN_NUMBERS; number++) {
        let sum = atomicLoad(&sums[lane * SCREEN_NUMBERS + number]);
        if (sum != 0) { add_words(at + number, sum); }
      }
    }
    if (lane == 0u) { is_open = atomicLoad(&unfinished); }
    if (workgroupUniformLoad(&is_open) == 0u) { break; }
  }
}
