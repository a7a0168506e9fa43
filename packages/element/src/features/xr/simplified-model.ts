import type { ReactiveController } from 'lit';
import { buttonBarOf } from '../../viewer/button-bar.js';
import type { Viewer } from '../../viewer/viewer.js';
import { languageOf } from '../../viewer/strings.js';
import { WORDS, type XrOffer } from './xr-offer.js';

/**
 * Whether the browser opens models in Quick Look. Such browsers declare the link type `ar`, and provide no WebXR to
 * scripts.
 */
const opensModels = (page: Document): boolean =>
  page.createElement('a').relList.supports('ar') || /iPhone|iPad/.test(page.defaultView?.navigator.userAgent ?? '');

/**
 * Whether the system draws splats of OpenUSD. No interface answers that; RealityKit draws them in the systems whose
 * browser has `<model>`. Older ones would show an empty room.
 */
const drawsSplats = (page: Document): boolean => 'HTMLModelElement' in (page.defaultView ?? {});

/**
 * Returns the address of the model for the link; null for an address of code, because sites fill attributes with texts of
 * others.
 */
function modelUrl(address: string | null, base: string): string | null {
  if (!address || !URL.canParse(address, base)) return null;
  const { protocol, href } = new URL(address, base);
  return /^(https?|blob|file):$/.test(protocol) ? href : null;
}

/**
 * Replacements of AR on devices without WebXR: a link to the splats or to the author's own mesh for iPhones, if the page
 * names one; otherwise the author's content in the slot `ar-fallback`.
 */
export class SimplifiedModel implements ReactiveController {
  readonly #core: Viewer;
  readonly #place: HTMLElement;
  readonly #offer: XrOffer;
  readonly #link: HTMLAnchorElement;
  readonly #element: HTMLElement;
  readonly #fallback: HTMLSlotElement;

  constructor(core: Viewer, offer: XrOffer) {
    const { element } = core;
    this.#core = core;
    this.#place = buttonBarOf(core);
    this.#offer = offer;
    this.#element = element;
    this.#link = Object.assign(element.ownerDocument.createElement('a'), { rel: 'ar' });
    this.#link.setAttribute('part', 'ar-link');
    // Quick Look opens links whose only child is an image.
    this.#link.append(element.ownerDocument.createElement('img'));
    this.#fallback = Object.assign(element.ownerDocument.createElement('slot'), { name: 'ar-fallback' });
  }

  hostUpdated(): void {
    const { attributes, strings } = this.#core;
    const modes = attributes.arModes?.trim() || 'webxr quick-look';
    const { baseURI, ownerDocument: page } = this.#element;
    const splats = drawsSplats(page) ? modelUrl(attributes.iosSplats, baseURI) : null;
    const model = splats ?? modelUrl(attributes.iosSrc, baseURI);
    const isOffered =
      attributes.ar &&
      model !== null &&
      !this.#offer.canActivate &&
      /(^|\s)quick-look(\s|$)/.test(modes) &&
      opensModels(page);
    const isReplaced =
      !isOffered && attributes.ar && this.#offer.isUnsupported && this.#element.querySelector('[slot=ar-fallback]');
    if (!isReplaced) this.#fallback.remove();
    else if (!this.#fallback.isConnected) this.#place.append(this.#fallback);
    if (!isOffered) return this.#link.remove();
    const text = strings['ar-simplified'] ?? WORDS['ar-simplified'];
    const image = this.#link.querySelector('img')!;
    image.alt = text;
    this.#link.lang = languageOf(strings) ?? '';
    this.#link.href = model;
    if (!this.#link.isConnected) this.#place.append(this.#link);
  }
}
