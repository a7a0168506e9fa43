import type { ReactiveControllerHost } from 'lit';
import type { Attributes } from './attributes.js';

export interface RevealHost {
  readonly attributes: Pick<Attributes, 'reveal'>;
  /** `hasImage`: whether a frame has been drawn that the element can show. */
  readonly sources: { readonly hasImage: boolean };
  posterDismissed(): void;
}

/**
 * Decides whether the poster covers the scene. It does so until the scene is shown, or until the page or a visitor
 * dismisses the poster.
 */
export class RevealController {
  readonly #host: ReactiveControllerHost;
  readonly #of: RevealHost;
  /**
   * Choice of the page by a method, or of the visitor by a click. While it is undefined, the attribute `reveal`
   * decides.
   */
  #requested: 'dismissed' | 'shown' | undefined;
  #wasCovered = true;

  constructor(host: ReactiveControllerHost, of: RevealHost) {
    this.#host = host;
    this.#of = of;
  }

  /** Whether the scene may be shown. Only then may a lazy scene be loaded. */
  get mayReveal(): boolean {
    return this.#requested === undefined ? this.#of.attributes.reveal === 'auto' : this.#requested === 'dismissed';
  }

  /** Whether the poster covers the scene. */
  get isCovered(): boolean {
    return !this.mayReveal || !this.#of.sources.hasImage;
  }

  dismiss(): void {
    this.#requested = 'dismissed';
    this.#host.requestUpdate();
  }

  cover(): void {
    this.#requested = 'shown';
    this.#host.requestUpdate();
  }

  /**
   * Calls the host's `posterDismissed` if the poster has uncovered the scene since the last call. Call after every
   * update.
   */
  settle(): void {
    const isCovered = this.isCovered;
    const isGone = this.#wasCovered && !isCovered;
    this.#wasCovered = isCovered;
    if (isGone) this.#of.posterDismissed();
  }
}
