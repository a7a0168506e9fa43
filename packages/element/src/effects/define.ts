import { SplatCutElement } from './splat-cut.js';

/** Registers the tag. */
export function defineCuts(): void {
  if (globalThis.customElements && !customElements.get('splat-cut'))
    customElements.define('splat-cut', SplatCutElement);
}
