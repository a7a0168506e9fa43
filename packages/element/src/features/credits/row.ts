import type { Credits } from '@gaussian-splat/core';
import { text } from '../../viewer/attribute.js';
import type { FeatureRow } from '../../viewer/features.js';

export const CREDITS_ATTRIBUTES = {
  /**
   * Names to credit, in a line over the frame. It replaces that of the file; an empty value hides it.
   * @default that of the scene's file
   * @example attribution="City Museum; Jane Doe"
   */
  attribution: text(),
  /**
   * License of the scene, as an SPDX identifier or a few words. It replaces that of the file. Licenses of Creative
   * Commons are links.
   * @default that of the scene's file
   * @example license="CC-BY-4.0"
   */
  license: text(),
};
type Table = typeof CREDITS_ATTRIBUTES;

export interface CreditsChangeDetail {
  /** Credits of all sources, without repetitions: first those of the element's own scene. Empty if there are none. */
  readonly credits: readonly Credits[];
}

/**
 * The line that credits the authors of a scene. Its code is loaded if an attribute or a file has credits.
 *
 * @slot credits - Content that replaces the line of credits.
 * @csspart credits - The line with the attribution and the license of the scene.
 * @cssproperty --credits-background - Background of the line of credits.
 * @cssproperty --credits-color - Text color of the line of credits.
 * @cssproperty --credits-font - Font of the line of credits.
 * @fires {CustomEvent<CreditsChangeDetail>} credits-change - Fired when the credits of the shown scenes have changed.
 */
export const credits: FeatureRow = {
  what: 'the code for credits',
  attributes: CREDITS_ATTRIBUTES,
  by: ({ attributes, sources }) =>
    attributes.attribution ?? attributes.license ?? sources.shown.find(({ credits }) => credits),
  open: async (viewer) => new (await import('./credit-line.js')).CreditLine(viewer),
};

declare module '../../viewer/events.js' {
  interface GaussianSplatEventMap {
    /** Fired when the credits of the shown scenes have changed. */
    'credits-change': CustomEvent<CreditsChangeDetail>;
  }
}

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
}
