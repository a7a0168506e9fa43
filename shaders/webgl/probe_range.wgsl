// Ranges of ranks, in which the splat at a point is searched for. Ranks are positions in the order from near to far.

struct ProbeView {
  // The range of the first search, as `range_of` reads it. Empty for later searches, of the ranges that were found.
  whole: vec4u,
}

// Number of runs that a range is divided into.
const RUNS = 1024u;

struct ProbeRange {
  first: u32,
  // One after the last rank: the first rank for a point that hides too little.
  end: u32,
  // Light that the splats before the range leave.
  light: f32,
}

fn range_of(found: vec4u) -> ProbeRange {
  return ProbeRange(found.x, found.y, bitcast<f32>(found.z));
}

fn run_of(range: ProbeRange) -> u32 {
  return max(1u, (range.end - range.first + RUNS - 1u) / RUNS);
}
