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

/** Strings of a page in place of the English ones. */
export type SpokenStrings = Readonly<Partial<Record<ViewName | 'interaction-prompt', string>>>;

/** What is said of a place. */
export const viewSentence = (name: ViewName, strings: SpokenStrings): string =>
  strings[name] ?? `View from ${name.replace('-', ' ')}`;

/**
 * The attribute `a11y`: an object, or its JSON.
 * @returns null where it is malformed.
 */
export function readSpokenStrings(value: unknown): SpokenStrings | null {
  if (value === null || value === undefined || value === '') return {};
  let parsed: unknown = value;
  if (typeof value === 'string') {
    try {
      parsed = JSON.parse(value);
    } catch {
      return null;
    }
  }
  const isObject = typeof parsed === 'object' && parsed !== null && !Array.isArray(parsed);
  if (!isObject) return null;
  const strings = Object.entries(parsed as object).filter(([, text]) => typeof text === 'string');
  return Object.fromEntries(strings) as SpokenStrings;
}
