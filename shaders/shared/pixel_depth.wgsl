// Densest depth of a splat along the ray of a pixel: the sort key of per-pixel order (decision 27).
//
// The splat is the drawn one: its Gaussian, widened on the screen by the low-pass filter. Its densest points along all
// rays of a perspective camera lie nearly in a plane through its center, and 1 / depth of a plane is linear on the
// screen; a splat that is deep for its distance bends it towards the camera. At an offset from the center, in pixels,
// with r² = u² + v² of the ellipse:
// depth = (1 - bend · r²) / (nearness + dot(slope, offset))
// For parallel rays the points lie in a plane, and depth itself is linear: depth = nearness + dot(slope, offset).
struct PixelDepth {
  slope: vec2f,
  nearness: f32,
  bend: f32,
}

// Depths at pixels are distinguished up to this many octaves beyond either end of the depth range of the visible
// centers.
const MARGIN_OCTAVES = 1u;
// Bits of a float32 that count the steps within an octave.
const OCTAVE_BITS = 23u;

// Limits of a depth at a pixel, as multiples of the depth of the center, for rays nearly parallel to a large flat splat.
const NEAREST_SHARE = 0.5;
const FARTHEST_SHARE = 2.0;
