// Histogram of splats by error threshold, over the logarithm of pixels.
const DETAIL_BUCKETS = 256u;
const BUCKETS_PER_OCTAVE = 8.0;
// Octaves from the first bucket to one pixel.
const BUCKET_OCTAVES = 16.0;

// Two arrays: splats added from each bucket on, then splats removed after each bucket.
const DETAIL_COUNTS = 512u;

fn bucket_of(pixels: f32) -> u32 {
  // Values below 2^-126 have no logarithm.
  let place = (log2(max(pixels, 1e-30)) + BUCKET_OCTAVES) * BUCKETS_PER_OCTAVE;
  return u32(clamp(place, 0.0, f32(DETAIL_BUCKETS) - 1.0));
}

// Pixels at the start of a bucket, which may be fractional.
fn bucket_start(bucket: f32) -> f32 {
  return exp2(bucket / BUCKETS_PER_OCTAVE - BUCKET_OCTAVES);
}
