import { text } from '../../viewer/attribute.js';
import type { FeatureRow } from '../../viewer/features.js';

export const SHADOW_ATTRIBUTES = {
  /**
   * Darkness of the shadow on the ground under the scene, 0 to 1. It is computed from the splats and meshes once, and
   * again when they change.
   * @default `0`: none. AR has one of `1`
   * @example shadow-intensity="1"
   */
  shadowIntensity: text<number | string | null>(),
  /**
   * How soft it is, 0 to 1.
   * @default `1`
   * @example shadow-softness="0.5"
   */
  shadowSoftness: text<number | string | null>(),
};
type Table = typeof SHADOW_ATTRIBUTES;

export const shadow: FeatureRow = {
  what: 'the code for shadows',
  attributes: SHADOW_ATTRIBUTES,
  by: ({ attributes }) => attributes.shadowIntensity,
  open: async (viewer) => new (await import('./shadow-controller.js')).ShadowController(viewer),
};

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
}
