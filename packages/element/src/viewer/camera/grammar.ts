import type { Vector3 } from '@gaussian-splat/core';

/**
 * Grammar of the camera attributes: tuples of numbers with CSS-like units, as in `<model-viewer>`, without `calc()` and
 * `env()`. Missing trailing values are `auto`. An absent attribute has its default value; a malformed one, too, with a
 * warning.
 */

/**
 * A distance: `meters` (one world unit is one meter), or `framings`, a multiple of the distance that frames the scene.
 */
export type RadiusSetting = { readonly meters: number } | { readonly framings: number } | 'auto';
/** An angle in radians. */
export type AngleSetting = number | 'auto';

/** Value of `camera-orbit`, `min-camera-orbit` and `max-camera-orbit`. Angles in radians. */
export interface OrbitSetting {
  readonly theta: AngleSetting;
  readonly phi: AngleSetting;
  readonly radius: RadiusSetting;
}

/** Value of `camera-target` and its limits: meters in viewer space. */
export type TargetSetting = readonly [x: number | 'auto', y: number | 'auto', z: number | 'auto'];

/** Grammar of one attribute: its parser, and its default. */
export interface AttributeGrammar<T> {
  /** The expected format, for warnings. */
  readonly expected: string;
  /** Default value, as text. */
  readonly fallback: string;
  /** Returns the value of the text; null if it is malformed. */
  parse(text: string): T | null;
}

const NUMBER_WITH_UNIT = /^([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?)([a-z%]*)$/i;
export const METERS_PER_UNIT: Readonly<Record<string, number>> = { '': 1, m: 1, cm: 1e-2, mm: 1e-3 };
const RADIANS_PER_UNIT: Readonly<Record<string, number>> = { deg: Math.PI / 180, rad: 1 };

interface Quantity {
  readonly value: number;
  readonly unit: string;
}

export function parseQuantity(term: string): Quantity | null {
  const match = NUMBER_WITH_UNIT.exec(term);
  const value = match ? Number(match[1]) : NaN;
  return match && Number.isFinite(value) ? { value, unit: match[2].toLowerCase() } : null;
}

function parseAngle(term: string): AngleSetting | null {
  if (term === 'auto') return 'auto';
  const quantity = parseQuantity(term);
  if (quantity === null) return null;
  // As in CSS, only zero may omit the unit, because degrees and radians could be confused.
  if (quantity.unit === '') return quantity.value === 0 ? 0 : null;
  const radians = RADIANS_PER_UNIT[quantity.unit];
  return radians === undefined ? null : quantity.value * radians;
}

function parseLength(term: string): number | 'auto' | null {
  if (term === 'auto') return 'auto';
  const quantity = parseQuantity(term);
  const meters = quantity === null ? undefined : METERS_PER_UNIT[quantity.unit];
  return quantity === null || meters === undefined ? null : quantity.value * meters;
}

function parseRadius(term: string): RadiusSetting | null {
  const quantity = parseQuantity(term);
  if (quantity?.unit === '%') return quantity.value > 0 ? { framings: quantity.value / 100 } : null;
  const meters = parseLength(term);
  if (meters === null || meters === 'auto') return meters;
  return meters > 0 ? { meters } : null;
}

const terms = (text: string): string[] => text.trim().toLowerCase().split(/\s+/);

function parseOrbit(text: string): OrbitSetting | null {
  const [first, second = 'auto', third = 'auto', ...rest] = terms(text);
  const [theta, phi, radius] = [parseAngle(first), parseAngle(second), parseRadius(third)];
  return theta === null || phi === null || radius === null || rest.length > 0 ? null : { theta, phi, radius };
}

function parseTarget(text: string): TargetSetting | null {
  const [x, y = 'auto', z = 'auto', ...rest] = terms(text).map(parseLength);
  return x === null || y === null || z === null || rest.length > 0 ? null : [x, y, z];
}

function parseFieldOfView(text: string): AngleSetting | null {
  const angle = parseAngle(text.trim().toLowerCase());
  return angle === 'auto' || (angle !== null && angle > 0 && angle < Math.PI) ? angle : null;
}

/** Parses an angle such as `30deg`. Returns radians; null for `auto` and malformed text. */
const parsePlainAngle = (text: string): number | null => {
  const angle = parseAngle(text.trim().toLowerCase());
  return angle === 'auto' ? null : angle;
};

/**
 * Parses three lengths such as `1m 2cm 0`. Returns meters; null if the text is malformed. Directions have the same
 * format.
 */
export function parsePoint(text: string): readonly [x: number, y: number, z: number] | null {
  const [x, y, z, ...rest] = terms(text).map(parseLength);
  const isPoint = typeof x === 'number' && typeof y === 'number' && typeof z === 'number' && rest.length === 0;
  return isPoint ? [x, y, z] : null;
}

const ORBIT_FORM =
  '"theta phi radius" with deg or rad, deg or rad, m, cm, mm or %; "auto" for each, or left out from the end';
const FIELD_OF_VIEW_FORM = 'an angle above 0deg and below 180deg with deg or rad, or "auto"';

/** Grammar of `camera-orbit`, `min-camera-orbit` and `max-camera-orbit`, with the text of the default. */
export const orbitGrammar = (fallback: string): AttributeGrammar<OrbitSetting> => ({
  expected: ORBIT_FORM,
  fallback,
  parse: parseOrbit,
});

/** Grammar of `field-of-view`, `min-field-of-view` and `max-field-of-view`: vertical angles, radians. */
export const fieldOfViewGrammar: AttributeGrammar<AngleSetting> = {
  expected: FIELD_OF_VIEW_FORM,
  fallback: 'auto',
  parse: parseFieldOfView,
};

/** Grammar of an angle such as `rotation-per-second`: radians. */
export const angleGrammar = (fallback: string): AttributeGrammar<number> => ({
  expected: 'an angle with deg or rad',
  fallback,
  parse: parsePlainAngle,
});

/** Grammar of `camera-target` and its limits. */
export const targetGrammar: AttributeGrammar<TargetSetting> = {
  expected: '"x y z" in meters (or with m, cm or mm); "auto" for each, or left out from the end',
  fallback: 'auto',
  parse: parseTarget,
};

/**
 * Parses an axis such as `-y`, or a direction of three numbers. Returns a unit vector; null if the text is malformed.
 */
export function parseUp(text: string): Vector3 | null {
  const [, sign, axis] = /^(-?)([xyz])$/.exec(terms(text).join(' ')) ?? [];
  const length = sign ? -1 : 1;
  const up = axis ? ['x', 'y', 'z'].map((name) => (name === axis ? length : 0)) : (parsePoint(text) ?? [0]);
  const size = Math.hypot(...up);
  return size > 0 ? (up.map((value) => value / size) as [number, number, number]) : null;
}

/** Grammar of `up`. The value `auto` is undefined, which selects the up direction of the scene. */
export const upGrammar: AttributeGrammar<Vector3 | undefined> = {
  expected: 'x, -x, y, -y, z, -z, or a direction such as "0.1 -1 0.2"',
  fallback: 'auto',
  parse: (text) => (text.trim() === 'auto' ? undefined : parseUp(text)),
};

/** Grammar of a number from `min` to `max`, such as `interpolation-decay` (milliseconds) and `max-pixel-ratio`. */
export const numberGrammar = (
  fallback: number,
  min: number,
  expected: string,
  max = Infinity,
): AttributeGrammar<number> => ({
  expected,
  fallback: String(fallback),
  parse: (text) => {
    const value = text.trim() === '' ? NaN : Number(text);
    return value >= min && value <= max ? value : null;
  },
});

/** Grammar of a keyword from a list, such as `touch-action`. The first keyword is the default. */
export const keywordGrammar = <T extends string>(keywords: readonly T[]): AttributeGrammar<T> => ({
  expected: `one of ${keywords.join(', ')}`,
  fallback: keywords[0],
  parse: (text) => keywords.find((keyword) => keyword === text.trim().toLowerCase()) ?? null,
});

/**
 * Parses an attribute. An absent, empty or malformed one has its default value; for a malformed one, `warn` is called
 * with a sentence about the expected format.
 */
export function readAttribute<T>(
  name: string,
  text: string | number | null | undefined,
  grammar: AttributeGrammar<T>,
  warn: (sentence: string) => void,
): T {
  // A test parses the default of each attribute.
  const fallback = (): T => grammar.parse(grammar.fallback)!;
  if (text === null || text === undefined || text === '') return fallback();
  const value = grammar.parse(String(text));
  if (value !== null) return value;
  warn(
    `<gaussian-splat> ${name}: expected ${grammar.expected}, found "${String(text).slice(0, 200)}"; the default "${grammar.fallback}" is used.`,
  );
  return fallback();
}
