// Paints tiles of 16 x 16 pixels, one workgroup each and one thread a pixel, front to back in float32 registers, and stops
// when nothing behind can be seen.
#import shared/bins
#import shared/coverage

@group(0) @binding(0) var<uniform> view: BinView;
@group(0) @binding(1) var<storage, read> splats: array<ProjectedSplat>;
@group(0) @binding(2) var<storage, read> sorted_pairs: array<BinPair>;
@group(0) @binding(3) var<storage, read> ranges: array<vec2u>;
@group(0) @binding(4) var accumulated: texture_storage_2d<rgba16float, write>;

const TILE_THREADS = TILE * TILE;
const HIT_WORDS = TILE_THREADS / 32u;
// A pixel is finished before a splat that would take its transmittance to this or below.
const TRANSMITTANCE_MIN = 1e-4;

// Of the batch of pairs at hand: a bit for each that touches the tile, and the splats of those, front to back.
var<workgroup> hits: array<atomic<u32>, HIT_WORDS>;
var<workgroup> shapes: array<vec4f, TILE_THREADS>;
var<workgroup> paints: array<vec4u, TILE_THREADS>;
// A bit for each quarter (8 x 8 pixels) of the tile that the splat touches.
var<workgroup> quarters: array<u32, TILE_THREADS>;
var<workgroup> unfinished: atomic<u32>;
var<workgroup> is_open: u32;

// Threads 0 to 63 paint the upper left quarter, and so on: neighbouring threads skip a splat together.
fn pixel_in_tile(lane: u32) -> vec2u {
  let quarter = lane / 64u;
  return vec2u((quarter % 2u) * 8u + lane % 8u, (quarter / 2u) * 8u + (lane / 8u) % 8u);
}

fn touched_quarters(s: ProjectedSplat, tile_corner: vec2f) -> u32 {
  let c = coverage_of(s);
  var mask = 0u;
  for (var row = 0u; row < 2u; row++) {
    let top = tile_corner.y + f32(row) * 8.0 + 0.5;
    let range = band_range(c, top - 0.01, top + 7.01) + vec2f(-0.01, 0.01) - tile_corner.x;
    if (range.x > range.y) { continue; }
    if (range.x <= 7.5 && range.y >= 0.5) { mask |= 1u << (2u * row); }
    if (range.x <= 15.5 && range.y >= 8.5) { mask |= 2u << (2u * row); }
  }
  return mask;
}

@compute @workgroup_size(TILE_THREADS)
fn main(@builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_index) lane: u32) {
  let corner = tile.xy * TILE;
  let pixel = corner + pixel_in_tile(lane);
  let center = vec2f(pixel) + 0.5;
  let own_quarter = 1u << (lane / 64u);
  let bin = tile.xy / vec2u(BIN_COLUMNS, BIN_ROWS);
  let in_bin = tile.xy % vec2u(BIN_COLUMNS, BIN_ROWS);
  let tile_bit = 1u << (in_bin.y * BIN_COLUMNS + in_bin.x);
  let range = ranges[bin.y * view.bins.x + bin.x];

  var color = vec3f(0.0);
  var transmittance = 1.0;
  var finished = any(center > view.viewport);
  for (var start = range.x; start < range.y; start += TILE_THREADS) {
    // Which pairs of the batch touch the tile, and where their splats go: the order of the pairs is kept.
    if (lane < HIT_WORDS) { atomicStore(&hits[lane], 0u); }
    if (lane == 0u) { atomicStore(&unfinished, 0u); }
    workgroupBarrier();
    var slot = 0u;
    var is_hit = false;
    if (start + lane < range.y) {
      let pair = sorted_pairs[start + lane];
      slot = pair.slot;
      is_hit = (pair.tiles & tile_bit) != 0u;
    }
    if (is_hit) { atomicOr(&hits[lane / 32u], 1u << (lane % 32u)); }
    if (!finished) { atomicOr(&unfinished, 1u); }
    workgroupBarrier();
    var place = countOneBits(atomicLoad(&hits[lane / 32u]) & ((1u << (lane % 32u)) - 1u));
    var count = 0u;
    for (var w = 0u; w < HIT_WORDS; w++) {
      let here = countOneBits(atomicLoad(&hits[w]));
      place += select(0u, here, w < lane / 32u);
      count += here;
    }
    if (lane == 0u) { is_open = atomicLoad(&unfinished); }
    if (is_hit) {
      let s = splats[slot];
      shapes[place] = s.shape;
      paints[place] = s.paint;
      quarters[place] = touched_quarters(s, vec2f(corner));
    }
    // Also the barrier between filling the lists and reading them.
    if (workgroupUniformLoad(&is_open) == 0u) { break; }

    for (var k = 0u; k < count && !finished; k++) {
      if ((quarters[k] & own_quarter) == 0u) { continue; }
      let shape = shapes[k];
      let paint = paints[k];
      let alpha = alpha_at(center - shape.xy, shape.z, shape.w, bitcast<f32>(paint.x), bitcast<f32>(paint.w));
      if (alpha < ALPHA_MIN) { continue; }
      let remaining = transmittance * (1.0 - alpha);
      if (remaining <= TRANSMITTANCE_MIN) {
        finished = true;
        break;
      }
      color += (transmittance * alpha) * splat_color(ProjectedSplat(shape, paint));
      transmittance = remaining;
    }
    workgroupBarrier();
  }
  if (all(center < view.viewport)) { textureStore(accumulated, pixel, vec4f(color, transmittance)); }
}
