/** Synchronized cameras: when a person moves one of two elements, the other follows in the next frame. */

/** @param a {HTMLElement} a `<gaussian-splat>` @param b {HTMLElement} another */
export function keepInStep(a, b) {
  follow(a, b);
  follow(b, a);
}

/**
 * Sets both cameras to the first one's exact values. Attributes are rounded, so an element that only follows would
 * differ slightly.
 */
export function align(a, b) {
  const view = viewOf(a);
  for (const element of [a, b]) show(element, view);
}

function follow(leader, follower) {
  leader.addEventListener('camera-change', ({ detail }) => {
    // A page's own camera changes have the source `none`, so that the follower's movement does not come back.
    if (detail.source !== 'none') show(follower, viewOf(leader));
  });
}

const viewOf = (element) => ({
  cameraOrbit: String(element.getCameraOrbit()),
  cameraTarget: String(element.getCameraTarget()),
  fieldOfView: String(element.getFieldOfView()),
});

function show(element, view) {
  Object.assign(element, view);
  element.jumpCameraToGoal();
}
