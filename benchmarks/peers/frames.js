/** The benchmark decides when a frame runs: callbacks of requestAnimationFrame wait until it says so. */

/** @returns a function that runs all waiting callbacks and says how many there were. */
export function holdAnimationFrames() {
  let waiting = new Map();
  let last = 0;
  window.requestAnimationFrame = (callback) => {
    waiting.set(++last, callback);
    return last;
  };
  window.cancelAnimationFrame = (id) => waiting.delete(id);
  return () => {
    const due = waiting;
    waiting = new Map();
    const now = performance.now();
    for (const callback of due.values()) callback(now);
    return due.size;
  };
}

/** Camera-to-world matrix in OpenGL axes (x right, y up, z backward), column-major, of a camera in OpenCV axes. */
export function cameraToWorldGl({ worldToCamera: m }) {
  const column = (k, sign) => [sign * m[4 * k], sign * m[4 * k + 1], sign * m[4 * k + 2], 0];
  const eye = [0, 1, 2].map((j) => -(m[j] * m[3] + m[4 + j] * m[7] + m[8 + j] * m[11]));
  return [...column(0, 1), ...column(1, -1), ...column(2, -1), ...eye, 1];
}

/** Vertical field of view in degrees. */
export const verticalFov = ({ height, fy }) => (360 / Math.PI) * Math.atan(height / (2 * fy));

/** Near and far planes of the peers, in world units; no path reaches either. */
export const NEAR = 0.05;
export const FAR = 1000;
