/** All attributes of `<gaussian-splat>`: its own, and those of its features. Only the element imports this module. */
import { keyword, type Attribute, type AttributeTable } from './attribute.js';
import {
  ATTRIBUTES,
  attributeOf,
  type Attributes,
  type Navigation,
  type Raw,
  type RawAttributes,
} from './attributes.js';
import { readAttribute } from './camera/grammar.js';
import FEATURES from './feature-table.js';

const NAVIGATIONS = Object.values(FEATURES).flatMap(({ navigation }) => navigation ?? []);

const NAVIGATION_ATTRIBUTES = {
  /**
   * `orbit` turns around the target. `fly` looks around, and moves with W, A, S, D, Q and E, faster with Shift. `walk` stays on the floor, which the element finds
   * in the splats: with W, A, S, D or the arrow keys, a click or a tap on the floor, a stick for the thumb, or a gamepad.
   * @default `orbit`
   * @example navigation="walk"
   */
  navigation: keyword<Navigation>(['orbit', ...NAVIGATIONS]),
};
type Table = typeof NAVIGATION_ATTRIBUTES;

/** Attributes by the names of their properties. */
export const ALL_ATTRIBUTES: AttributeTable = Object.assign(
  {},
  ATTRIBUTES,
  NAVIGATION_ATTRIBUTES,
  ...Object.values(FEATURES).map(({ attributes }) => attributes),
);
const entries = Object.entries(ALL_ATTRIBUTES) as [keyof RawAttributes, Attribute<unknown, unknown>][];

/** The boolean properties. */
export const flags = entries.filter(([, { lit }]) => lit.type === Boolean).map(([name]) => name);

/** Parses all attributes; `warn` is called with one sentence for each malformed one. */
export function readAttributes(raw: RawAttributes, warn: (sentence: string) => void): Attributes {
  const values = Object.fromEntries(
    entries.map(([name, { grammar }]) => [
      name,
      grammar ? readAttribute(attributeOf(name), raw[name] as Raw, grammar, warn) : raw[name],
    ]),
  ) as unknown as Omit<Attributes, 'camera'>;
  return {
    ...values,
    camera: {
      orbit: values.cameraOrbit,
      target: values.cameraTarget,
      minTarget: values.minCameraTarget,
      maxTarget: values.maxCameraTarget,
      fieldOfView: values.fieldOfView,
      minOrbit: values.minCameraOrbit,
      maxOrbit: values.maxCameraOrbit,
      minFieldOfView: values.minFieldOfView,
      maxFieldOfView: values.maxFieldOfView,
      up: values.up,
      orthographic: values.orthographic,
    },
  };
}

declare module './attributes.js' {
  interface FeatureAttributes extends Table {}
}
