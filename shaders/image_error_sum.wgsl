// Adds up the tiles of several images from the first pass, one workgroup for each image.
#import shared/image_sums

struct ImageErrors {
  // Capacity in tiles of each image; unused tiles are zero.
  tiles: u32,
}

@group(0) @binding(0) var<uniform> images: ImageErrors;
@group(0) @binding(1) var<storage, read> tiles: array<vec2f>;
// Sum of squares and number of covered pixels for each image.
@group(0) @binding(2) var<storage, read_write> errors: array<vec2f>;

@compute @workgroup_size(SUM_THREADS)
fn main(@builtin(workgroup_id) image: vec3u, @builtin(local_invocation_index) lane: u32) {
  var own = vec2f(0.0);
  for (var k = lane; k < images.tiles; k += SUM_THREADS) { own += tiles[image.x * images.tiles + k]; }
  let sum = sum_of_all(own, lane);
  if (lane == 0u) { errors[image.x] = sum; }
}
