// Bounds of 256 splats in page-local coordinates: the box of their centres, and the farthest that any of them reaches with
// alpha >= 1/255.
struct Chunk {
  low: vec3f,
  reach: f32,
  high: vec3f,
  unused: f32,
}
