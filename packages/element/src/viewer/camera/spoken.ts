/** Names of the camera position for screen readers: one of four sides, and the height. */

/** Names of all positions, as in `<model-viewer>`. They are also keys of the attribute `a11y`. */
export const VIEW_NAMES = [
  'front',
  'right',
  'back',
  'left',
  'upper-front',
  'upper-right',
  'upper-back',
  'upper-left',
  'lower-front',
  'lower-right',
  'lower-back',
  'lower-left',
] as const;

/** One of {@link VIEW_NAMES}. */
export type ViewName = (typeof VIEW_NAMES)[number];

const QUARTERS = ['front', 'right', 'back', 'left'] as const;

/** Returns the name of a camera position. @param theta Azimuth, radians. @param phi Polar angle, radians. */
export function viewName(theta: number, phi: number): ViewName {
  const quarter = Math.round(theta / (Math.PI / 2));
  const side = QUARTERS[((quarter % 4) + 4) % 4];
  // The upper third of the polar range counts as looking from above, the lower third from below.
  if (phi < Math.PI / 3) return `upper-${side}`;
  return phi > (2 * Math.PI) / 3 ? `lower-${side}` : side;
}
