// Compares an image with a reference: squared differences of the three colors, over the pixels that the reference
// covers, summed for each tile.
#import shared/image_sums

// Premultiplied red, green, blue and alpha.
@group(0) @binding(0) var image: texture_2d<f32>;
@group(0) @binding(1) var reference: texture_2d<f32>;
// Sum of squares and number of covered pixels for each tile, row by row.
@group(0) @binding(2) var<storage, read_write> tiles: array<vec2f>;

const ERROR_TILE = 16u;

@compute @workgroup_size(SUM_THREADS)
fn main(@builtin(workgroup_id) tile: vec3u, @builtin(num_workgroups) grid: vec3u, @builtin(local_invocation_index) lane: u32) {
  let pixel = tile.xy * ERROR_TILE + vec2u(lane % ERROR_TILE, lane / ERROR_TILE);
  var own = vec2f(0.0);
  if (all(pixel < textureDimensions(reference))) {
    let expected = textureLoad(reference, pixel, 0);
    if (expected.w != 0.0) {
      let difference = textureLoad(image, pixel, 0).xyz - expected.xyz;
      own = vec2f(dot(difference, difference), 1.0);
    }
  }
  let sum = sum_of_all(own, lane);
  if (lane == 0u) { tiles[tile.y * grid.x + tile.x] = sum; }
}
