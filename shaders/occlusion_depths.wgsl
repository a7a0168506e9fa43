// How far one will see in this frame, from how far one saw in the last: one thread for each tile. Tiles are traced back to where
// they were, and get the farthest depth of all tiles near there, so that it errs towards seeing too far.
// Where it errs the other way `rasterize_tiles` notices and opens the tile for the next frame.
#import shared/occlusion

struct OcclusionView {
  // From the space of this camera to that of the last one, and back.
  to_last: mat4x4f,
  from_last: mat4x4f,
  // Focal lengths and principal points in pixels.
  focal: vec2f,
  principal: vec2f,
  last_focal: vec2f,
  last_principal: vec2f,
  // Pixels.
  viewport: vec2f,
  // Tiles across and down.
  tiles: vec2u,
  // 0 if the last frame tells nothing about this one.
  is_known: u32,
}

@group(0) @binding(0) var<uniform> view: OcclusionView;
// For each tile the depth at which its last pixel was finished in the last frame.
@group(0) @binding(1) var<storage, read> last_depths: array<u32>;
// Of tiles, then of blocks; the latter 0 at first.
@group(0) @binding(2) var<storage, read_write> depths: array<atomic<u32>>;

const OCCLUSION_THREADS = 8u;
// Tiles, across or down, that may have to be looked at: what moves faster is not traced.
const REACH_MAX = 10;
// Depths are stored with 11 bits, and the last pixel of a tile is not finished by the same splat each time.
const DEPTH_MARGIN = 1.01;
// Pixels by which the place of a tile is widened; less than 0, so that rounding does not make it look at its neighbours too.
const WIDER = -0.05;
const FAR_OFF = -1e9;

// Where a direction (w = 0) or a point (w = 1) of this camera's space was in the last image.
fn last_place(p: vec4f) -> vec2f {
  let q = (view.to_last * p).xyz;
  if (q.z <= 1e-6 * length(q)) { return vec2f(FAR_OFF); }
  return q.xy / q.z * view.last_focal + view.last_principal;
}

// This camera's depth of what was seen at `depth` through the middle of a tile of the last image.
fn depth_now(tile: vec2i, depth: f32) -> f32 {
  let pixel = min((vec2f(tile) + 0.5) * f32(TILE), view.viewport);
  let point = vec3f((pixel - view.last_principal) / view.last_focal, 1.0) * depth;
  return (view.from_last * vec4f(point, 1.0)).z;
}

fn seen_depth(tile: vec2u) -> u32 {
  if (view.is_known == 0u) { return OPEN; }
  let last = last_depths[tile.y * view.tiles.x + tile.x];
  var low = vec2f(1e9);
  var high = vec2f(-1e9);
  for (var k = 0u; k < 4u; k++) {
    let corner = min(vec2f((tile + vec2u(k % 2u, k / 2u)) * TILE), view.viewport);
    let ray = vec3f((corner - view.principal) / view.focal, 1.0);
    // Where it was if it is far away, and if it is as near as what was in its place.
    let far = last_place(vec4f(ray, 0.0));
    low = min(low, far);
    high = max(high, far);
    if (last != OPEN) {
      let near = last_place(vec4f(ray * bitcast<f32>(last), 1.0));
      low = min(low, near);
      high = max(high, near);
    }
  }
  // Half a pixel of rounding; what comes in from outside is not known.
  if (any(low < vec2f(-0.5)) || any(high > view.viewport + 0.5)) { return OPEN; }
  let first = max(vec2i(floor((low - WIDER) / f32(TILE))), vec2i(0));
  let end = min(vec2i(ceil((high + WIDER) / f32(TILE))), vec2i(view.tiles));
  if (any(end - first > vec2i(REACH_MAX))) { return OPEN; }
  var depth = 0.0;
  for (var y = first.y; y < end.y; y++) {
    for (var x = first.x; x < end.x; x++) {
      let seen = last_depths[u32(y) * view.tiles.x + u32(x)];
      if (seen == OPEN) { return OPEN; }
      depth = max(depth, depth_now(vec2i(x, y), bitcast<f32>(seen)));
    }
  }
  return bitcast<u32>(DEPTH_MARGIN * depth);
}

@compute @workgroup_size(OCCLUSION_THREADS, OCCLUSION_THREADS)
fn main(@builtin(global_invocation_id) id: vec3u) {
  if (any(id.xy >= view.tiles)) { return; }
  let depth = seen_depth(id.xy);
  atomicStore(&depths[id.y * view.tiles.x + id.x], depth);
  let own = id.xy / OCCLUSION_BLOCK;
  let blocks = occlusion_blocks(view.tiles);
  let place = view.tiles.x * view.tiles.y + own.y * blocks.x + own.x;
  atomicMax(&depths[place], depth);
}
