// Replaces the depths of splat centers, found by `probe_depth`, by the densest depths along the rays: the visible
// surface. Runs for one block of Gaussians at a time and lists its survivors again, because the sort has overwritten
// the list.
#import shared/densest
#import shared/stored_gaussian
#import shared/plan
#import shared/group
#import shared/probe
#import shared/probe_answer

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<StoredGaussian>;
@group(0) @binding(2) var<storage, read> survivors: array<u32>;
@group(0) @binding(3) var<storage, read> plan: Plan;
@group(0) @binding(4) var<storage, read> points: array<ProbePoint>;
@group(0) @binding(5) var<storage, read_write> answers: array<ProbeAnswer>;

@compute @workgroup_size(PROBE_LEVELS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) level: u32) {
  let at = group_index(workgroup_id);
  if (at >= arrayLength(&answers)) { return; }
  let page = plan.pages[view.page];
  let slot = answers[at].slots[level];
  let is_here = slot >= page.first_slot && slot < page.first_slot + page.survivors;
  if (!is_here || answers[at].depths[level] == 0.0) { return; }
  let splat = survivors[slot];
  answers[at].stored[level] = splat + 1u;
  let g = unpack_gaussian(gaussian_at(splat - view.first_group * CULL_GROUP));
  let surface = surface_at(view, g, points[at].pixel);
  if (surface.depth > 0.0) { answers[at].depths[level] = surface.depth; }
  if (level == PROBE_MIDDLE) { answers[at].thickness = surface.thickness; }
}
