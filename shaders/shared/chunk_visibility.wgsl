// Tests whether a chunk may hold visible splats. The tests are linear in camera space, so the corners of a box decide
// for all its points, and errors only keep too much.
#import shared/view
#import shared/chunk

// Pixels that dilation can add to the half extent of a splat (sqrt(0.3 · 2 ln 255) = 1.83), plus one for rounding.
const MARGIN = 3.0;

// Minimum of normal · (camera-space point) over the box.
fn smallest_along(view: View, center: vec3f, half_size: vec3f, normal: vec3f) -> f32 {
  let local = vec3f(
    dot(view.local_to_camera[0].xyz, normal), dot(view.local_to_camera[1].xyz, normal), dot(view.local_to_camera[2].xyz, normal),
  );
  let middle = dot(local, center) + dot(view.local_to_camera[3].xyz, normal);
  let slack = 1e-5 * (dot(abs(local), abs(center)) + abs(dot(view.local_to_camera[3].xyz, normal)));
  return middle - dot(abs(local), half_size) - slack;
}

fn may_be_visible(view: View, c: Chunk) -> bool {
  let center = 0.5 * (c.low + c.high);
  let half_size = 0.5 * (c.high - c.low);
  if (smallest_along(view, center, half_size, vec3f(0.0, 0.0, -1.0)) > -view.near) { return false; }
  if (smallest_along(view, center, half_size, vec3f(0.0, 0.0, 1.0)) > view.far) { return false; }
  // The Jacobian stretches a splat by at most focal / z · sqrt(1 + t²); times z, that is the same for all points.
  let t = max(abs(view.jacobian_min), abs(view.jacobian_max));
  let reach = 1.001 * c.reach * view.stretch * view.focal * sqrt(1.0 + t * t);
  // The edges of the image, in pixels: scaled by the depth if rays diverge, constant if they are parallel.
  let low = -view.principal - MARGIN;
  let high = view.principal - view.viewport - MARGIN;
  let grows = select(1.0, 0.0, view.is_orthographic != 0u);
  let from_low = reach - (1.0 - grows) * low;
  let from_high = reach - (1.0 - grows) * high;
  return smallest_along(view, center, half_size, vec3f(view.focal.x, 0.0, grows * high.x)) <= from_high.x
    && smallest_along(view, center, half_size, vec3f(-view.focal.x, 0.0, grows * low.x)) <= from_low.x
    && smallest_along(view, center, half_size, vec3f(0.0, view.focal.y, grows * high.y)) <= from_high.y
    && smallest_along(view, center, half_size, vec3f(0.0, -view.focal.y, grows * low.y)) <= from_low.y;
}
