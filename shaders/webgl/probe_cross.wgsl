// Finds the run behind which less than a fraction of the light is left: one fragment for each point and fraction. The last row
// has the light that all splats of a point leave, and those in front of its depth.
#import shared/probe_levels
#import webgl/probe_range
#import shared/full_screen

@group(0) @binding(0) var<uniform> probed: ProbeView;

// Light that each run leaves, and its splats in front of the point: see `probe`.
@group(0) @binding(1) var runs: texture_2d<u32>;
@group(0) @binding(2) var ranges: texture_2d<u32>;

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4u {
  let place = vec2u(position.xy);
  let is_sum = place.y == PROBE_LEVELS;
  var range = range_of(probed.whole);
  let is_first = range.end > 0u;
  var row = place.x;
  if (!is_first) {
    let found = textureLoad(ranges, place, 0);
    if (is_sum) { return found; }
    range = range_of(found);
    row += place.y * textureDimensions(ranges).x;
  }
  let run = run_of(range);
  let used = (range.end - range.first + run - 1u) / run;
  let share = light_left(place.y);
  var light = range.light;
  var light_in_front = 1.0;
  var at = used;
  for (var i = 0u; i < used; i++) {
    let passed = bitcast<vec2f>(textureLoad(runs, vec2u(i, row), 0).xy);
    let after = light * passed.x;
    light_in_front *= passed.y;
    if (!is_sum && after < share) {
      at = i;
      break;
    }
    light = after;
  }
  if (is_sum) { return bitcast<vec4u>(vec4f(light, light_in_front, 0.0, 0.0)); }
  // A range that was found has a crossing; rounding may move it behind the last run.
  if (!is_first && used > 0u) { at = min(at, used - 1u); }
  if (at == used) { return vec4u(0u); }
  let first = range.first + at * run;
  return vec4u(first, min(first + run, range.end), bitcast<u32>(light), 0u);
}
