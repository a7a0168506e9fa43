/**
 * The visitor's camera as readable attributes: degrees and meters, with the visible digits. The distance is in percent of the framing distance, so that the view fits images of other shapes, too.
 */

const degrees = (radians) => `${Number(((radians * 180) / Math.PI).toFixed(2))}deg`;
const meters = (value) => `${Number(value.toPrecision(5))}m`;

/** @param element {HTMLElement} a `<gaussian-splat>` @returns {Record<string, string>} attributes by name */
export function viewOf(element) {
  const { theta, phi, radius, framingRadius } = element.getCameraOrbit();
  const { x, y, z } = element.getCameraTarget();
  return {
    'camera-orbit': `${degrees(theta)} ${degrees(phi)} ${Number(((100 * radius) / framingRadius).toFixed(1))}%`,
    'camera-target': [x, y, z].map(meters).join(' '),
    'field-of-view': degrees(element.getFieldOfView().radians),
  };
}
