import type { ReactiveController, ReactiveControllerHost } from 'lit';
import { windowOf } from './size-controller.js';

/**
 * More than nothing must be visible: with a threshold of 0 an element that only touches the viewport's edge would
 * count, and with a margin elements off screen would take frame time from those on it.
 */
const THRESHOLD = 1e-5;

/** Knows whether any part of the element is in the viewport. */
export class VisibilityController implements ReactiveController {
  readonly #element: HTMLElement;
  readonly #onChange: () => void;
  #observer: IntersectionObserver | undefined;
  #isVisible = false;

  constructor(host: ReactiveControllerHost & HTMLElement, onChange: () => void) {
    this.#element = host;
    this.#onChange = onChange;
    host.addController(this);
  }

  get isVisible(): boolean {
    return this.#isVisible;
  }

  hostConnected(): void {
    const { IntersectionObserver } = windowOf(this.#element);
    // Documents of unit tests (jsdom) have no layout.
    if (!IntersectionObserver) return this.#set(true);
    this.#observer = new IntersectionObserver((entries) => this.#set(entries[entries.length - 1].isIntersecting), {
      threshold: THRESHOLD,
    });
    this.#observer.observe(this.#element);
  }

  hostDisconnected(): void {
    this.#observer?.disconnect();
    this.#set(false);
  }

  #set(isVisible: boolean): void {
    if (isVisible === this.#isVisible) return;
    this.#isVisible = isVisible;
    this.#onChange();
  }
}
