// Splats that are looked at for each error that may be allowed: a histogram over the logarithm of pixels.
const DETAIL_BUCKETS = 256u;
const BUCKETS_PER_OCTAVE = 8.0;
// Octaves from the first bucket to a pixel.
const BUCKET_OCTAVES = 16.0;

// From each bucket on so many splats more, and behind those: behind each bucket so many fewer.
const DETAIL_COUNTS = 512u;

fn bucket_of(pixels: f32) -> u32 {
  // Less than 2^-126 has no logarithm.
  let place = (log2(max(pixels, 1e-30)) + BUCKET_OCTAVES) * BUCKETS_PER_OCTAVE;
  return u32(clamp(place, 0.0, f32(DETAIL_BUCKETS) - 1.0));
}

// Pixels where a bucket starts; part of a bucket counts.
fn bucket_start(bucket: f32) -> f32 {
  return exp2(bucket / BUCKETS_PER_OCTAVE - BUCKET_OCTAVES);
}
