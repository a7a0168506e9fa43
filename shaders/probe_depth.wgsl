// Finds the splats under single points of the last frame, for picking and for the occlusion of labels. One workgroup
// for each point; each lane walks one run of the splats, from near to far, and a prefix product joins the 64 runs.
#import shared/probe
#import shared/probe_answer
#import shared/plan
#import shared/group

@group(0) @binding(0) var<storage, read> plan: Plan;
@group(0) @binding(1) var<storage, read> splats: array<ProjectedSplat>;
// Slots from near to far.
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> points: array<ProbePoint>;
@group(0) @binding(4) var<storage, read_write> answers: array<ProbeAnswer>;

const PROBE_LANES = 64u;

var<workgroup> runs: array<f32, PROBE_LANES>;
var<workgroup> runs_in_front: array<f32, PROBE_LANES>;

@compute @workgroup_size(PROBE_LANES)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let at = group_index(workgroup_id);
  if (at >= arrayLength(&answers)) { return; }
  let point = points[at];
  let length = (plan.visible + PROBE_LANES - 1u) / PROBE_LANES;
  let first = min(lane * length, plan.visible);
  let end = min(first + length, plan.visible);
  var light = 1.0;
  var light_in_front = 1.0;
  for (var rank = first; rank < end; rank++) {
    let s = splats[order[rank]];
    let share = passes(s, point);
    light *= share;
    if (splat_depth(s) < point.depth) { light_in_front *= share; }
  }
  runs[lane] = light;
  runs_in_front[lane] = light_in_front;
  workgroupBarrier();
  if (lane == 0u) {
    var left = 1.0;
    var in_front = 1.0;
    for (var run = 0u; run < PROBE_LANES; run++) {
      left *= runs[run];
      in_front *= runs_in_front[run];
    }
    answers[at].thickness = 0.0;
    answers[at].opacity = 1.0 - left;
    answers[at].in_front = in_front;
  }
  if (lane < PROBE_LEVELS) { find(at, point, lane, length); }
}

// The first splat, from near to far, behind which less than a fraction of the light is left.
fn find(at: u32, point: ProbePoint, level: u32, length: u32) {
  let share = light_left(level);
  var total = 1.0;
  var before = 1.0;
  var crossing = PROBE_LANES;
  for (var run = 0u; run < PROBE_LANES; run++) {
    if (crossing == PROBE_LANES && total * runs[run] < share) {
      crossing = run;
      before = total;
    }
    total *= runs[run];
  }
  var depth = 0.0;
  var slot = 0u;
  for (var rank = crossing * length; rank < min((crossing + 1u) * length, plan.visible); rank++) {
    let s = splats[order[rank]];
    before *= passes(s, point);
    if (before < share) {
      depth = splat_depth(s);
      slot = order[rank];
      break;
    }
  }
  answers[at].depths[level] = depth;
  answers[at].slots[level] = slot;
  answers[at].stored[level] = 0u;
}
