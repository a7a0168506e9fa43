/** Where a person has turned the camera, as attributes that people read: degrees and metres, as many digits as show. */

const degrees = (radians) => `${Number(((radians * 180) / Math.PI).toFixed(2))}deg`;
const metres = (value) => `${Number(value.toPrecision(5))}m`;

/** @param element {HTMLElement} a `<gaussian-splat>` @returns {Record<string, string>} attributes by name */
export function viewOf(element) {
  const { theta, phi, radius } = element.getCameraOrbit();
  const { x, y, z } = element.getCameraTarget();
  return {
    'camera-orbit': `${degrees(theta)} ${degrees(phi)} ${metres(radius)}`,
    'camera-target': [x, y, z].map(metres).join(' '),
    'field-of-view': degrees(element.getFieldOfView().radians),
  };
}
