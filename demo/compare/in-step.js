/** Synchronised cameras: whichever of two elements a person moves, the other is where it is in the next frame. */

/** @param a {HTMLElement} a `<gaussian-splat>` @param b {HTMLElement} another */
export function keepInStep(a, b) {
  follow(a, b);
  follow(b, a);
}

/** Puts both cameras where the first is, to the last bit: attributes are rounded, so that whoever only follows is a hair aside. */
export function align(a, b) {
  const view = viewOf(a);
  for (const element of [a, b]) show(element, view);
}

function follow(leader, follower) {
  leader.addEventListener('camera-change', ({ detail }) => {
    // What a page does to a camera is `none`: the follower's own move must not come back.
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
