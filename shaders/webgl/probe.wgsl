// Finds the splats under a point: each fragment of a row walks one run of the splats, as each lane of `probe_depth`
// does.
#import shared/probe
#import webgl/projected_splats
#import shared/full_screen

@group(0) @binding(0) var<uniform> probed: ProbeView;

struct ProbeView {
  point: ProbePoint,
  // Ranks of the first splat and of the one after the last, and the length of a run.
  first: u32,
  end: u32,
  run: u32,
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4u {
  let first = probed.first + u32(position.x) * probed.run;
  let end = min(first + probed.run, probed.end);
  var light = 1.0;
  var light_in_front = 1.0;
  var depth = 0.0;
  for (var rank = first; rank < end; rank++) {
    let s = splat_at(rank);
    if (s.paint.w == 0u) { continue; }
    let share = passes(s, probed.point);
    light *= share;
    depth = splat_depth(s);
    if (depth < probed.point.depth) { light_in_front *= share; }
  }
  return bitcast<vec4u>(vec4f(light, light_in_front, depth, 0.0));
}
