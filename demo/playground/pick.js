/** Points of a scene that a visitor clicks on. */

/** A press that moves farther than this, in CSS pixels, turned the scene and points at nothing. */
const MAX_MOTION = 5;

/**
 * @param scene {HTMLElement} a `<gaussian-splat>` whose scene is shown
 * @param signal {AbortSignal} ends it
 * @returns {Promise<{ x: number, y: number, z: number } | null>} the surface at the next click, null beside the scene; rejects if `signal` is aborted.
 */
export function pickPoint(scene, signal) {
  return new Promise((resolve, reject) => {
    if (signal.aborted) return reject(signal.reason);
    const done = new AbortController();
    const until = { signal: AbortSignal.any([signal, done.signal]) };
    let pressed = { x: 0, y: 0 };
    signal.addEventListener('abort', () => reject(signal.reason), { once: true });
    scene.addEventListener('pointerdown', ({ clientX: x, clientY: y }) => (pressed = { x, y }), until);
    scene.addEventListener(
      'click',
      ({ clientX, clientY }) => {
        if (Math.hypot(clientX - pressed.x, clientY - pressed.y) > MAX_MOTION) return;
        done.abort();
        scene.positionFromPoint(clientX, clientY).then(resolve, reject);
      },
      until,
    );
  });
}
