import { text } from '../../viewer/attribute.js';
import type { GaussianSplatError } from '@gaussian-splat/core';
import type { FeatureRow } from '../../viewer/features.js';

export const EFFECTS_ATTRIBUTES = {
  /**
   * How the scene appears: `fade`, `grow` from its center, `sweep` along an axis (`x`, `-y` ...), or `detail`, from coarse to fine while it loads; with a time such as `2s`. Visitors who
   * ask for less motion see it at once. The property `revealProgress`, 0 to 1, drives it by hand.
   * @default `none`
   * @example reveal-effect="sweep y 2s"
   */
  revealEffect: text(),
};
type Table = typeof EFFECTS_ATTRIBUTES;

/**
 * Cuts, the reveal effect, and the page's own shader.
 *
 * @fires {CustomEvent<GaussianSplatError>} shader-error - Fired when the function of `splatShader` does not compile; `detail` contains the line. The scene is drawn without it.
 */
export const effects: FeatureRow = {
  what: 'the code of effects',
  attributes: EFFECTS_ATTRIBUTES,
  by: ({ attributes, source }) => attributes.revealEffect || source.splatShader,
  children: 'splat-cut',
  precedesFrames: true,
  open: async (viewer) => new (await import('./effects.js')).Effects(viewer),
};

declare module '../../viewer/events.js' {
  interface GaussianSplatEventMap {
    /** Fired when the hook of `splatShader` does not compile; `detail` names the line. The scene is drawn without it. */
    'shader-error': CustomEvent<GaussianSplatError>;
  }
}

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
}
