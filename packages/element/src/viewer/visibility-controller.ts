import type { ReactiveController, ReactiveControllerHost } from 'lit';
import { windowOf } from './size-controller.js';

/**
 * Fraction of the element's area that counts as visible. With 0 an element that only touches the edge of the viewport
 * would count. With a margin around the viewport, off-screen elements would take frame time from visible ones.
 */
const THRESHOLD = 1e-5;

/** Tracks whether any part of the element is in the viewport. */
export class VisibilityController implements ReactiveController {
  readonly #element: HTMLElement;
  readonly #onChange: () => void;
  #observer: IntersectionObserver | undefined;
  /** Whether the element is in the viewport; undefined until the observer has reported. */
  #isVisible: boolean | undefined;

  constructor(host: ReactiveControllerHost & HTMLElement, onChange: () => void) {
    this.#element = host;
    this.#onChange = onChange;
    host.addController(this);
  }

  get isVisible(): boolean {
    return this.#isVisible === true;
  }

  /** Whether the element is known to be off-screen: false before the first report. */
  get isKnownHidden(): boolean {
    return this.#isVisible === false;
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
    this.#isVisible = undefined;
  }

  #set(isVisible: boolean): void {
    const wasVisible = this.isVisible;
    this.#isVisible = isVisible;
    if (isVisible !== wasVisible) this.#onChange();
  }
}
