import { text } from '../../viewer/attribute.js';
import type { FeatureRow } from '../../viewer/features.js';

export const SKY_ATTRIBUTES = {
  /**
   * URL of an equirectangular image (JPEG, PNG, WebP or AVIF) that surrounds the scene. Its middle lies at +x, as in `<model-viewer>`. It is in saved images and videos, and not in VR and AR.
   * @default none
   * @example skybox-image="meadow.jpg"
   */
  skyboxImage: text(),
};
type Table = typeof SKY_ATTRIBUTES;

export const sky: FeatureRow = {
  what: 'the code for skies',
  attributes: SKY_ATTRIBUTES,
  by: ({ attributes }) => attributes.skyboxImage,
  open: async (viewer) => new (await import('./sky.js')).Sky(viewer),
};

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
}
