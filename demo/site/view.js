/**
 * Where a person has turned the camera, as attributes that people read: degrees and metres, as many digits as show. The distance is in percent of what frames the
 * scene, so that the view fits pictures of other shapes, too.
 */

const degrees = (radians) => `${Number(((radians * 180) / Math.PI).toFixed(2))}deg`;
const metres = (value) => `${Number(value.toPrecision(5))}m`;

/** @param element {HTMLElement} a `<gaussian-splat>` @returns {Record<string, string>} attributes by name */
export function viewOf(element) {
  const { theta, phi, radius, framingRadius } = element.getCameraOrbit();
  const { x, y, z } = element.getCameraTarget();
  return {
    'camera-orbit': `${degrees(theta)} ${degrees(phi)} ${Number(((100 * radius) / framingRadius).toFixed(1))}%`,
    'camera-target': [x, y, z].map(metres).join(' '),
    'field-of-view': degrees(element.getFieldOfView().radians),
  };
}
