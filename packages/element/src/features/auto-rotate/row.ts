import { flag, milliseconds, number, read } from '../../viewer/attribute.js';
import { angleGrammar } from '../../viewer/camera/grammar.js';
import type { FeatureRow } from '../../viewer/features.js';

export const AUTO_ROTATE_ATTRIBUTES = {
  /**
   * Turns the camera around the scene. It rests while a visitor uses the scene, and continues after `auto-rotate-delay`. It does not start for visitors who ask for less motion, nor while the scene has the
   * keyboard. A button stops it.
   * @example auto-rotate
   */
  autoRotate: flag(),
  /**
   * Milliseconds at rest before it turns.
   * @default `3000`
   * @example auto-rotate-delay="10000"
   */
  autoRotateDelay: number(milliseconds(3_000)),
  /**
   * How fast it turns.
   * @default `5.625deg`
   * @example rotation-per-second="30deg"
   */
  rotationPerSecond: read(angleGrammar('5.625deg')),
};
type Table = typeof AUTO_ROTATE_ATTRIBUTES;

export const autoRotate: FeatureRow = {
  what: 'the code that turns the camera',
  attributes: AUTO_ROTATE_ATTRIBUTES,
  by: ({ attributes }) => attributes.autoRotate,
  open: async (viewer) => new (await import('./auto-rotate-controller.js')).AutoRotateController(viewer),
};

/**
 * The button with which a visitor pauses automatic motion.
 *
 * @csspart pause-button - The button that pauses `auto-rotate` and `autoplay`.
 * @cssproperty [--pause-button-display=block] - `none` hides the pause button, for pages with a control of their own.
 */
export const motion: FeatureRow = {
  what: 'the code of the switch for motion',
  by: ({ attributes, player }) => attributes.autoRotate || player,
  open: async (viewer) => new (await import('./motion-controller.js')).MotionController(viewer),
};

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
}
