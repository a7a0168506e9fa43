import type { ReactiveControllerHost } from 'lit';
import type { Reveal } from '../attributes.js';

export interface RevealOptions {
  readonly mode: () => Reveal;
  /** True once there is a picture to reveal. */
  readonly isReady: () => boolean;
  readonly onDismissed: () => void;
}

/** Whether the poster covers the scene: until the scene is there, or until the page or a person dismisses it. */
export class RevealController {
  readonly #host: ReactiveControllerHost;
  readonly #options: RevealOptions;
  /** What was asked for by a method or a click; until then the attribute decides. */
  #wish: 'dismissed' | 'shown' | undefined;
  #wasCovered = true;

  constructor(host: ReactiveControllerHost, options: RevealOptions) {
    this.#host = host;
    this.#options = options;
  }

  /** The scene may be seen; a lazy one may therefore be loaded. */
  get mayReveal(): boolean {
    return this.#wish === undefined ? this.#options.mode() === 'auto' : this.#wish === 'dismissed';
  }

  /** The poster covers the scene. */
  get isCovered(): boolean {
    return !this.mayReveal || !this.#options.isReady();
  }

  dismiss(): void {
    this.#wish = 'dismissed';
    this.#host.requestUpdate();
  }

  cover(): void {
    this.#wish = 'shown';
    this.#host.requestUpdate();
  }

  /** Tells of a poster that has gone. Called after every update. */
  settle(): void {
    const isCovered = this.isCovered;
    const isGone = this.#wasCovered && !isCovered;
    this.#wasCovered = isCovered;
    if (isGone) this.#options.onDismissed();
  }
}
