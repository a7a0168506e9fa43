// Bounds of 256 splats in block-local coordinates: the box of their centers, and the largest reach of any of them with
// alpha >= 1/255.
struct Chunk {
  low: vec3f,
  reach: f32,
  high: vec3f,
  unused: f32,
}
