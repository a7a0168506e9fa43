import { SplatCutElement } from './splat-cut.js';

/** Registers `<splat-cut>`, unless it is registered or the environment has no custom elements. */
export function defineCuts(): void {
  if (globalThis.customElements && !customElements.get('splat-cut'))
    customElements.define('splat-cut', SplatCutElement);
}
