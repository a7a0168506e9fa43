// Finds the splats at points: each fragment of a row walks one run of the splats of a range, as each lane of
// `probe_depth` does. The first search has a row for each point, later ones have one for each point and fraction of the light.
#import shared/probe
#import webgl/projected_splats
#import webgl/probe_range
#import shared/full_screen

@group(0) @binding(0) var<uniform> probed: ProbeView;

// x, y and depth of a point, as the bits of float32: one texel for each point.
@group(0) @binding(4) var asked: texture_2d<u32>;
// Ranges of the points, one row for each fraction.
@group(0) @binding(5) var ranges: texture_2d<u32>;

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4u {
  let row = u32(position.y);
  let points = textureDimensions(asked).x;
  let question = bitcast<vec4f>(textureLoad(asked, vec2u(row % points, 0u), 0));
  let point = ProbePoint(question.xy, question.z);
  var range = range_of(probed.whole);
  if (range.end == 0u) { range = range_of(textureLoad(ranges, vec2u(row % points, row / points), 0)); }
  let run = run_of(range);
  let first = range.first + u32(position.x) * run;
  let end = min(first + run, range.end);
  var light = 1.0;
  var light_in_front = 1.0;
  for (var rank = first; rank < end; rank++) {
    let s = splat_at(rank);
    if (s.paint.w == 0u) { continue; }
    let share = passes(s, point);
    light *= share;
    if (splat_depth(s) < point.depth) { light_in_front *= share; }
  }
  return bitcast<vec4u>(vec4f(light, light_in_front, 0.0, 0.0));
}
