/** What a screen reader says of the camera's place: words for the quarter and the height from which a person looks. */

/** The places that are told apart, as `<model-viewer>` names them; these are also the keys of the attribute `a11y`. */
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

/** The place of a camera. @param theta azimuth, radians. @param phi polar angle, radians. */
export function viewName(theta: number, phi: number): ViewName {
  const quarter = Math.round(theta / (Math.PI / 2));
  const side = QUARTERS[((quarter % 4) + 4) % 4];
  // A third of the way from the top to the bottom counts as looking from above, the last third from below.
  if (phi < Math.PI / 3) return `upper-${side}`;
  return phi > (2 * Math.PI) / 3 ? `lower-${side}` : side;
}

/** What is said of a place. */
export const viewSentence = (name: ViewName, strings: Readonly<Partial<Record<ViewName, string>>>): string =>
  strings[name] ?? `View from ${name.replace('-', ' ')}`;
