/** Parts of the shadow tree for visitors who may move the camera. Loaded with the input controller. */
import { css, html, nothing, svg, type TemplateResult } from 'lit';
import { adoptStyles } from '../../viewer/styles.js';
import { CORNER_STYLES, cornerButton } from '../../viewer/corner-button.js';
import { languageOf, type A11yStrings } from '../../viewer/strings.js';

const WORDS = {
  'keys-orbit':
    'Arrow keys turn the view, Page Up and Page Down or plus and minus change the distance, ' +
    'Shift with the arrow keys moves it sideways, Home brings it back.',
  'interaction-prompt': 'Drag to look around',
  reset: 'Reset view',
};

const STYLES = css`
  .prompt {
    display: var(--interaction-prompt-display, flex);
    align-items: end;
    justify-content: center;
    padding-block-end: 8px;
  }
  [part='interaction-prompt'] {
    padding: 10px;
    border-radius: 50%;
    line-height: 0;
    background: var(--interaction-prompt-background, rgb(0 0 0 / 0.45));
    color: var(--interaction-prompt-color, rgb(255 255 255));
  }
  [part='interaction-prompt'].wiggle {
    animation: wiggle 4.5s;
  }
  @keyframes wiggle {
    12.5%,
    62.5% {
      transform: translateX(-24px);
    }
    37.5%,
    87.5% {
      transform: translateX(24px);
    }
  }
  [part='reset-button'] {
    display: var(--reset-button-display, block);
    inset-inline: 8px auto;
  }
  @media (prefers-reduced-motion: reduce) {
    [part='interaction-prompt'] {
      animation: none;
    }
  }
`;

/** SVG path of the reset icon: four corners around a square. */
const FRAME_SIGN = 'M4 9V4h5v2H6v3zM15 4h5v5h-2V6h-3zM4 15h2v3h3v2H4zM18 15h2v5h-5v-2h3zM10 10h4v4h-4z';

/** State of the parts for visitors who may move the camera. */
export interface Hands {
  /** Help text for the keys; empty for those of the orbit, null if visitors may not move the camera. */
  readonly keys: string | null;
  /** Style of the prompt that shows that the scene can be moved. */
  readonly prompt: 'none' | 'basic' | 'wiggle';
  /** Resets the camera; null if the reset button is not shown. */
  readonly onReset: (() => void) | null;
  readonly strings: A11yStrings;
}

const word = (strings: A11yStrings, key: keyof typeof WORDS): string => strings[key] ?? WORDS[key];

/** Template of the keyboard help, the interaction prompt, and the button that resets the camera. */
export function handsView({ keys, prompt: kind, onReset, strings }: Hands): TemplateResult {
  const help = html`<span id="keys" class="for-screen-readers" hidden lang=${languageOf(strings) ?? nothing}
    >${keys || word(strings, 'keys-orbit')}</span
  >`;
  return html`${keys === null ? nothing : help} ${kind === 'none' ? nothing : prompt(kind, strings)}
  ${onReset ? cornerButton('reset-button', word(strings, 'reset'), FRAME_SIGN, onReset, strings) : nothing}`;
}

/** Template of the prompt, a dragging hand. Screen readers announce the keys instead when the scene has the focus. */
function prompt(kind: Hands['prompt'], strings: A11yStrings): TemplateResult {
  const hand = svg`<path d="M9 11.24V7.5a2.5 2.5 0 0 1 5 0v3.74a4.5 4.5 0 1 0-5 0zm9.84 4.63-4.54-2.26a1 1 0 0 0-.54-.11H13v-6a1.5
    1.5 0 0 0-3 0v10.74l-3.43-.72a1 1 0 0 0-1 .33l-.57.62 4.94 4.94a1.5 1.5 0 0 0 1.06.44h6.79a1.5 1.5 0 0 0 1.48-1.29l.75-5.27a1.5
    1.5 0 0 0-.18-1.42z" />`;
  return html`<div class="layer prompt">
    <slot name="interaction-prompt">
      <div
        part="interaction-prompt"
        class=${kind}
        role="img"
        lang=${languageOf(strings) ?? nothing}
        aria-label=${word(strings, 'interaction-prompt')}
      >
        <svg viewBox="0 0 24 24" width="44" height="44" aria-hidden="true" fill="currentColor">${hand}</svg>
      </div>
    </slot>
  </div>`;
}

export const addHandStyles = (root: ShadowRoot): void => adoptStyles(root, CORNER_STYLES, STYLES);
