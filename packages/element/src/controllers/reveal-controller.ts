import type { ReactiveControllerHost } from 'lit';
import type { Attributes } from '../attributes.js';

export interface RevealHost {
  readonly attributes: Pick<Attributes, 'reveal'>;
  /** Whether there is a frame to reveal. */
  readonly hasImage: boolean;
  posterDismissed(): void;
}

/** Whether the poster covers the scene: until the scene is shown, or until the page or a visitor dismisses it. */
export class RevealController {
  readonly #host: ReactiveControllerHost;
  readonly #of: RevealHost;
  /** Choice by a method or a click; until then the attribute decides. */
  #requested: 'dismissed' | 'shown' | undefined;
  #wasCovered = true;

  constructor(host: ReactiveControllerHost, of: RevealHost) {
    this.#host = host;
    this.#of = of;
  }

  /** Whether the scene may be shown, so that a lazy one may be loaded. */
  get mayReveal(): boolean {
    return this.#requested === undefined ? this.#of.attributes.reveal === 'auto' : this.#requested === 'dismissed';
  }

  /** Whether the poster covers the scene. */
  get isCovered(): boolean {
    return !this.mayReveal || !this.#of.hasImage;
  }

  dismiss(): void {
    this.#requested = 'dismissed';
    this.#host.requestUpdate();
  }

  cover(): void {
    this.#requested = 'shown';
    this.#host.requestUpdate();
  }

  /** Fires the event of a dismissed poster. Called after every update. */
  settle(): void {
    const isCovered = this.isCovered;
    const isGone = this.#wasCovered && !isCovered;
    this.#wasCovered = isCovered;
    if (isGone) this.#of.posterDismissed();
  }
}
