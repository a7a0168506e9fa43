import { css } from 'lit';
import { ArLabels } from './ar-labels.js';
import type { Viewer } from '../../viewer/viewer.js';
import { languageOf } from '../../viewer/strings.js';
import { WORDS } from './xr-offer.js';

export const AR_STYLES = css`
  .ar-overlay {
    position: absolute;
    inset: 0;
    display: none;
    z-index: 3;
    pointer-events: none;
  }
  .ar-overlay.shown {
    display: block;
  }
  .ar-overlay button,
  .ar-overlay ::slotted(button) {
    pointer-events: auto;
  }
  .ar-overlay button {
    position: absolute;
    inset-block-start: 16px;
    inset-inline-end: 16px;
    font: inherit;
    padding: 8px 14px;
    border: 0;
    border-radius: 999px;
    color: rgb(255 255 255);
    background: rgb(0 0 0 / 0.7);
  }
`;

/**
 * Overlay of an AR session on a phone: an exit button, the author's prompt until the object is placed, and labels after
 * that.
 */
export class ArOverlay {
  readonly root: HTMLElement;
  readonly labels: ArLabels;
  readonly #core: Viewer;
  readonly #prompt: HTMLSlotElement;
  readonly #exit: HTMLButtonElement;
  onExit: () => void = () => undefined;

  constructor(core: Viewer) {
    const { element } = core;
    const { ownerDocument: page } = element;
    this.#core = core;
    this.root = page.createElement('div');
    this.root.className = 'ar-overlay';
    this.#prompt = Object.assign(page.createElement('slot'), { name: 'ar-prompt' });
    const slot = Object.assign(page.createElement('slot'), { name: 'exit-ar-button' });
    this.#exit = Object.assign(page.createElement('button'), { type: 'button' });
    this.#exit.setAttribute('part', 'exit-ar-button');
    slot.append(this.#exit);
    slot.addEventListener('click', () => this.onExit());
    // A touch of the button is no input for the session, which would move the object.
    this.root.addEventListener('beforexrselect', (event) => {
      if (event.composedPath().includes(slot)) event.preventDefault();
    });
    this.labels = new ArLabels(element, this.root);
    this.root.append(this.#prompt, slot);
    // If several slots have the same name, the browser assigns the children to the first.
    element.shadowRoot!.prepend(this.root);
  }

  show(): void {
    const { strings } = this.#core;
    this.#exit.textContent = strings['exit-ar'] ?? WORDS['exit-ar'];
    this.#exit.lang = languageOf(strings) ?? '';
    this.#prompt.hidden = false;
    this.root.classList.add('shown');
  }

  placed(): void {
    this.#prompt.hidden = true;
    this.labels.show();
  }

  hide(): void {
    this.root.classList.remove('shown');
    this.labels.hide();
  }
}
