/** Template and styles of a button in a corner of the frame. Loaded on demand. */
import { css, html, nothing, type TemplateResult } from 'lit';
import { languageOf, type A11yStrings } from './strings.js';

export const CORNER_STYLES = css`
  .corner {
    position: absolute;
    inset-block-end: 8px;
    inset-inline-end: 8px;
    padding: 8px;
    border: 0;
    border-radius: 50%;
    line-height: 0;
    cursor: pointer;
    background: var(--interaction-prompt-background, rgb(0 0 0 / 0.45));
    color: var(--interaction-prompt-color, rgb(255 255 255));
  }
`;

/**
 * Returns a round button. `part` is its CSS part, `label` its accessible name, `sign` the SVG path data of its icon, in
 * a view box of 24 x 24.
 */
export const cornerButton = (
  part: string,
  label: string,
  sign: string,
  onClick: () => void,
  strings: A11yStrings,
): TemplateResult =>
  html`<button
    type="button"
    class="corner"
    part=${part}
    aria-label=${label}
    lang=${languageOf(strings) ?? nothing}
    @click=${onClick}
  >
    <svg viewBox="0 0 24 24" width="20" height="20" aria-hidden="true" fill="currentColor"><path d=${sign} /></svg>
  </button>`;
