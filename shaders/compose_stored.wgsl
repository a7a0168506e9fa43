// Composes in a compute shader, into a storage texture: some GPUs compute fast but draw slowly.
#import shared/compose

@group(0) @binding(2) var image: texture_storage_2d<rgba16float, write>;

const COMPOSE_SIDE = 8;

@compute @workgroup_size(COMPOSE_SIDE, COMPOSE_SIDE)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
  if (any(pixel.xy >= textureDimensions(image))) { return; }
  textureStore(image, pixel.xy, composed(vec2f(pixel.xy) + 0.5));
}
