import { keyword, milliseconds, number } from '../../viewer/attribute.js';
import type { FeatureRow } from '../../viewer/features.js';

export const PROMPT_ATTRIBUTES = {
  /**
   * `auto` shows visitors who have not touched the scene that it can be rotated. `none` does not.
   * @default `auto`
   * @example interaction-prompt="none"
   */
  interactionPrompt: keyword<InteractionPrompt>(['auto', 'none']),
  /**
   * `basic` is a still image. `wiggle` swings the camera once, which draws frames.
   * @default `basic`
   * @example interaction-prompt-style="wiggle"
   */
  interactionPromptStyle: keyword<InteractionPromptStyle>(['basic', 'wiggle']),
  /**
   * Milliseconds without interaction before the prompt is shown.
   * @default `3000`
   * @example interaction-prompt-threshold="0"
   */
  interactionPromptThreshold: number(milliseconds(3_000)),
};
type Table = typeof PROMPT_ATTRIBUTES;

/** Whether visitors are shown how to move the camera. */
export type InteractionPrompt = 'auto' | 'none';

/** `wiggle` swings the camera with the prompt; `basic` keeps it still. */
export type InteractionPromptStyle = 'wiggle' | 'basic';

/**
 * Mouse, touch and keyboard, and the help for them.
 *
 * @slot interaction-prompt - Shown to visitors who have not touched the scene yet.
 * @csspart interaction-prompt - The default interaction prompt.
 * @csspart reset-button - Resets the camera: shown to visitors who have moved it by touch.
 * @cssproperty [--interaction-prompt-display=flex] - `none` hides the interaction prompt.
 * @cssproperty --interaction-prompt-background - Background of the default prompt.
 * @cssproperty --interaction-prompt-color - Text color of the default prompt.
 * @cssproperty [--reset-button-display=block] - `none` hides the reset button.
 */
export const input: FeatureRow = {
  what: 'the code for mouse, touch and keys',
  attributes: PROMPT_ATTRIBUTES,
  by: (viewer) => viewer.input.enabled,
  open: async (viewer) => {
    const [{ InputController }] = await Promise.all([import('./input-controller.js'), viewer.announcer.get()]);
    return new InputController(viewer);
  },
};

/** Announces the view to screen readers. */
export const announcer: FeatureRow = {
  what: 'the code that speaks of the view',
  open: async (viewer) => new (await import('./input-controller.js')).AnnouncerController(viewer),
};

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
}
