import { css, type CSSResult } from 'lit';

const stylesOf = new WeakMap<ShadowRoot, CSSResult[]>();

/**
 * Adds styles to a shadow tree. Without `more`, creates its style sheets again, for a new document: documents reject
 * the style sheets of others. Does nothing in a document without a window, which renders nothing.
 */
export function adoptStyles(root: ShadowRoot, ...more: CSSResult[]): void {
  const before = stylesOf.get(root) ?? [styles];
  const all = [...before, ...more.filter((each) => !before.includes(each))];
  stylesOf.set(root, all);
  const view = root.ownerDocument.defaultView as (Window & typeof globalThis) | null;
  if (view === null) return;
  root.adoptedStyleSheets = all.map(({ cssText }) => {
    const sheet = new view.CSSStyleSheet();
    sheet.replaceSync(cssText);
    return sheet;
  });
}

/**
 * Styles of the element. Default size and containment match those of an image. Pages can change the appearance with
 * custom properties and parts. `hidden` overrides any `display` that a page sets for the time before the script runs.
 */
export const styles = css`
  :host {
    display: block;
    position: relative;
    width: 300px;
    height: auto;
    aspect-ratio: 2;
    contain: strict;
  }
  :host([hidden]:not([hidden='until-found'])) {
    display: none !important;
  }
  .view,
  .layer {
    position: absolute;
    inset: 0;
  }
  .view:focus-visible {
    outline: auto;
    outline-offset: -2px;
  }
  .interactive {
    cursor: grab;
    user-select: none;
    -webkit-user-select: none;
  }
  .interactive:active {
    cursor: grabbing;
  }
  canvas {
    display: block;
    width: 100%;
    height: 100%;
  }
  .layer {
    pointer-events: none;
  }
  .poster {
    transition:
      opacity var(--poster-transition, 0.3s),
      visibility var(--poster-transition, 0.3s);
  }
  .poster img,
  .poster ::slotted(*) {
    display: block;
    width: 100%;
    height: 100%;
    object-fit: var(--poster-fit, cover);
  }
  .poster ::slotted(*),
  [part='poster-button'] {
    pointer-events: auto;
  }
  [part='poster-button'] {
    display: block;
    position: relative;
    width: 100%;
    height: 100%;
    padding: 0;
    border: 0;
    background: none;
    cursor: pointer;
  }
  [part='poster-button']:focus-visible {
    outline: auto;
    outline-offset: -2px;
  }
  .covered canvas {
    visibility: hidden;
  }
  [part='poster-icon'] {
    padding: 10px;
    border-radius: 50%;
    line-height: 0;
    background: var(--interaction-prompt-background, rgb(0 0 0 / 0.45));
    color: var(--interaction-prompt-color, rgb(255 255 255));
    position: absolute;
    top: 50%;
    left: 50%;
    translate: -50% -50%;
  }
  .gone {
    opacity: 0;
    visibility: hidden;
  }
  .progress {
    inset: auto 0 0;
  }
  [part='progress-track'] {
    height: var(--progress-bar-height, 4px);
    overflow: hidden;
    background: var(--progress-track-color, rgb(128 128 128 / 0.3));
  }
  [part='progress-bar'] {
    height: 100%;
    width: 100%;
    transform-origin: 0 0;
    background: var(--progress-bar-color, rgb(0 110 220));
  }
  [part='progress-bar']:dir(rtl) {
    transform-origin: 100% 0;
  }
  .message {
    display: flex;
    align-items: safe center;
    justify-content: center;
    padding: 1em;
    overflow: auto;
    pointer-events: auto;
  }
  [part='fallback'],
  [part='error'] {
    max-width: 40em;
    padding: 0.75em 1em;
    border-radius: 6px;
    background: var(--message-background, rgb(255 255 255 / 0.92));
    color: var(--message-color, rgb(30 30 30));
    font: var(--message-font, 0.875rem/1.4 system-ui, sans-serif);
    overflow-wrap: anywhere;
  }
  [part='fallback'] {
    align-self: end;
    padding: 0.3em 0.6em;
    font: var(--message-font, 0.75rem/1.4 system-ui, sans-serif);
  }
  p {
    margin: 0;
  }
  /* Sentences have their own direction, not the page's: the details are always English. */
  p,
  summary,
  span {
    unicode-bidi: plaintext;
  }
  p + details {
    margin-top: 0.5em;
  }
  .for-screen-readers {
    position: absolute;
    width: 1px;
    height: 1px;
    overflow: hidden;
    clip-path: inset(50%);
    white-space: nowrap;
  }
  @media (forced-colors: active) {
    [part='progress-track'] {
      background: CanvasText;
    }
    [part='progress-bar'] {
      background: Highlight;
    }
  }
  @media (prefers-reduced-motion: reduce) {
    .poster {
      transition: none;
    }
  }
`;
