/** Synchronised cameras: whichever of two elements a person moves, the other is where it is in the next frame. */

/** @param a {HTMLElement} a `<gaussian-splat>` @param b {HTMLElement} another */
export function keepInStep(a, b) {
  follow(a, b);
  follow(b, a);
}

function follow(leader, follower) {
  leader.addEventListener('camera-change', ({ detail }) => {
    // What a page does to a camera is `none`: the follower's own move must not come back.
    if (detail.source === 'none') return;
    follower.cameraOrbit = String(leader.getCameraOrbit());
    follower.cameraTarget = String(leader.getCameraTarget());
    follower.fieldOfView = String(leader.getFieldOfView());
    follower.jumpCameraToGoal();
  });
}
