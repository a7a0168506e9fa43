/** The bar with the buttons that features add to a corner of the frame. Loaded on demand. */
import { css } from 'lit';
import { adoptStyles } from './styles.js';
import type { Viewer } from './viewer.js';

const STYLES = css`
  .buttons {
    position: absolute;
    inset-block-end: 8px;
    inset-inline-start: 8px;
    max-inline-size: calc(100% - 60px);
    display: flex;
    flex-wrap: wrap;
    gap: 8px;
    z-index: 2;
  }
  .buttons:empty {
    display: none;
  }
  /* Otherwise the reset button has the corner of these buttons. Here it is above the pause button. */
  .buttons:not(:empty) ~ [part='reset-button'] {
    inset-block-end: 52px;
    inset-inline: auto 8px;
  }
  .buttons button {
    font: inherit;
    padding: 8px 14px;
    border: 0;
    border-radius: 999px;
    cursor: pointer;
    background: var(--interaction-prompt-background, rgb(0 0 0 / 0.7));
    color: var(--interaction-prompt-color, rgb(255 255 255));
  }
  .buttons button[aria-pressed='true'] {
    outline: 2px solid currentcolor;
  }
`;

const bars = new WeakMap<Viewer, HTMLElement>();

/** Returns the bar of an element, which is added for its first button. */
export function buttonBarOf(viewer: Viewer): HTMLElement {
  let bar = bars.get(viewer);
  if (bar === undefined) {
    const { element, surface } = viewer;
    adoptStyles(element.shadowRoot!, STYLES);
    bar = Object.assign(element.ownerDocument.createElement('div'), { className: 'buttons' });
    bars.set(viewer, bar);
    surface?.after(bar);
  }
  return bar;
}
