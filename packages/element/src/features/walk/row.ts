import { text } from '../../viewer/attribute.js';
import type { FeatureRow } from '../../viewer/features.js';

export const WALK_ATTRIBUTES = {
  /**
   * URL of a map of the floor for `navigation="walk"`, written by `gaussian-splat floor`, or of voxels (`.voxel.json`) of splat-transform. `auto` makes one from the splats after the scene has loaded.
   * @default `auto`
   * @example walk-map="garden.floor"
   */
  walkMap: text(),
  /**
   * Height of a walker's eyes above the floor, with `m`, `cm` or `mm`.
   * @default `1.6m`
   * @example eye-height="1.2m"
   */
  eyeHeight: text(),
};
type Table = typeof WALK_ATTRIBUTES;

export interface WalkReadyDetail {
  /** Area of the floor, m². */
  readonly area: number;
}

/**
 * Walking on the floor of the scene.
 *
 * @csspart joystick - The stick of `navigation="walk"` on touch screens.
 * @fires {CustomEvent<WalkReadyDetail>} walk-ready - Fired when the floor of `navigation="walk"` is known and the camera stands on it.
 */
export const walk: FeatureRow = {
  what: 'the code for walking',
  attributes: WALK_ATTRIBUTES,
  navigation: 'walk',
  by: ({ attributes }) => attributes.navigation === 'walk',
  open: async (viewer) => new (await import('./walk-controller.js')).WalkController(viewer),
};

declare module '../../viewer/events.js' {
  interface GaussianSplatEventMap {
    /** Fired when the floor of `navigation="walk"` is known and the camera stands on it. */
    'walk-ready': CustomEvent<WalkReadyDetail>;
  }
}

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
  interface FeatureNavigations {
    walk: true;
  }
}
