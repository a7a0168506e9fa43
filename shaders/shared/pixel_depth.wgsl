// Where along the ray of a pixel a splat is densest: what orders splats where each pixel has an order of its own (decision 27).
//
// The splat is the one that is painted: its Gaussian, widened on the screen by the low-pass filter. Its densest points along all rays of a perspective camera lie
// nearly in a plane through its centre, and 1 / depth of a plane is linear on the screen; a splat that is deep for its distance bends it towards the camera. At
// an offset from the centre, in pixels, with r² = u² + v² of the ellipse:
//   depth = (1 - bend · r²) / (nearness + dot(slope, offset))
// Where rays are parallel the points lie in a plane, and depth itself is linear: depth = nearness + dot(slope, offset).
struct PixelDepth {
  slope: vec2f,
  nearness: f32,
  bend: f32,
}

// Octaves on either side of the depths of the visible centres that depths at pixels are told apart in.
const MARGIN_OCTAVES = 1u;
// Bits of a float32 that count the steps of an octave.
const OCTAVE_BITS = 23u;
