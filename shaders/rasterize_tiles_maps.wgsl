// Rasterizes tiles, and writes depth and identity of each pixel.
#import shared/paint_columns
#import shared/whole_lists
#import shared/column_rows
#import shared/pixel_depth

@group(0) @binding(7) var<storage, read> pixel_depths: array<PixelDepth>;
// Ids of the owners of the splats by slot, from 1 on.
@group(0) @binding(8) var<storage, read> owners: array<u32>;
// Mean of the depths by the weights of the splats, depth of the splat that halves the transmittance, coverage, and the
// id of the owner with the largest sum of weights. Depths are in world units along the optical axis; 0 for none.
@group(0) @binding(9) var maps: texture_storage_2d<rgba32float, write>;

// True for parallel rays.
override is_parallel: bool = false;

// Owners that the pixels of a thread can have at the same time.
const OWNERS = 16u;

// Slots of the splats of the batch, and of the placeholder for missing ones.
var<workgroup> slots: array<u32, BATCH + 1u>;

// Center of the topmost pixel of a thread, and the sums of its pixels.
var<private> topmost: vec2f;
var<private> weights: Column;
var<private> weighted_depth: Column;
var<private> median: Column;
var<private> owner_ids: array<u32, OWNERS>;
var<private> owner_weights: array<Column, OWNERS>;

fn load_more(k: u32, slot: u32, s: ProjectedSplat, tile_corner: vec2f) { slots[k] = slot; }

fn start_hiding(position: vec2u) { topmost = vec2f(position) + 0.5; }
fn hide(pixels: ptr<function, Pixels>, k: u32) {}
fn hide_rest(pixels: ptr<function, Pixels>) {}
fn aux_clear(lane: u32) {}
fn aux_store(k: u32) {}

// Depth of the highest density of a splat along the ray of each pixel, with the numbers of shared/pixel_depth. The exact
// maximum of a Gaussian with covariance Σ on the ray r = r0 + δ, r0 = center / z, is z rᵀΣ⁻¹r0 / rᵀΣ⁻¹r, which equals
// z L / (L² + bend r²) with L = 1 + δᵀΣ⁻¹r0 / r0ᵀΣ⁻¹r0: linear on the screen.
fn depths_at(slot: u32) -> Column {
  let s = splats[slot];
  let d = pixel_depths[slot];
  let x = topmost.x - s.shape.x;
  let y = (topmost.y - s.shape.y) + STEPS;
  let linear = d.nearness + (d.slope.x * x + d.slope.y * y);
  if (is_parallel) { return clamp(linear, Column(NEAREST_SHARE * d.nearness), Column(FARTHEST_SHARE * d.nearness)); }
  let u = x * s.shape.z;
  let v = (y - s.shape.w * x) * bitcast<f32>(s.paint.x);
  let share = max(linear / d.nearness, Column(0.0));
  let below = max(share * share + d.bend * (u * u + v * v), Column(1e-12));
  return clamp(share / below, Column(NEAREST_SHARE), Column(FARTHEST_SHARE)) / d.nearness;
}

// Adds the weights of a splat to those of its owner. If all places are taken, it replaces the owner
// with the lowest weight.
fn note_owner(id: u32, weight: Column) {
  var lowest = 0u;
  for (var k = 0u; k < OWNERS; k++) {
    if (owner_ids[k] == id || owner_ids[k] == 0u) {
      owner_ids[k] = id;
      owner_weights[k] += weight;
      return;
    }
    if (largest(owner_weights[k]) < largest(owner_weights[lowest])) { lowest = k; }
  }
  owner_ids[lowest] = id;
  owner_weights[lowest] = weight;
}

fn aux_blend(k: u32, weight: Column, before: Column, after: Column, is_blended: Flags) {
  if (largest(weight) <= 0.0) { return; }
  let depth = depths_at(slots[k]);
  weights += weight;
  weighted_depth += weight * depth;
  median = select(median, depth, is_blended & (before > Column(0.5)) & (after <= Column(0.5)));
  note_owner(owners[slots[k]], weight);
}

fn aux_pixel(pixel: vec2u, row: u32) {
  var id = 0u;
  var highest = 0.0;
  for (var k = 0u; k < OWNERS; k++) {
    let own = row_of(owner_weights[k], row);
    if (own > highest) {
      highest = own;
      id = owner_ids[k];
    }
  }
  let coverage = row_of(weights, row);
  let expected = select(0.0, row_of(weighted_depth, row) / coverage, coverage > 0.0);
  textureStore(maps, pixel, vec4f(expected, row_of(median, row), coverage, f32(id)));
}
