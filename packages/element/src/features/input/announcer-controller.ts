import type { ReactiveController, ReactiveControllerHost } from 'lit';
import type { ViewName } from '../../viewer/camera/spoken.js';
import type { A11yStrings } from '../../viewer/strings.js';

export interface AnnouncerHost {
  readonly viewName: ViewName;
  readonly core: { readonly strings: A11yStrings };
  /** Whether the frame has keyboard focus. */
  readonly isFocused: boolean;
}

/** Minimum interval between two announcements, ms, because a screen reader that is always interrupted says nothing. */
const INTERVAL_MS = 700;

/**
 * Announces the side from which the camera views the scene, for visitors who move the camera by keyboard and cannot see
 * the frame. Speaks only while the frame has keyboard focus, and at a limited rate.
 */
export class AnnouncerController implements ReactiveController {
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #of: AnnouncerHost;
  /** Whether camera moves are not announced: during a flight, which announces its own destination. */
  isQuiet = false;
  #text = '';
  #spoken: ViewName | undefined;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(host: ReactiveControllerHost & HTMLElement, of: AnnouncerHost) {
    this.#host = host;
    this.#of = of;
    host.addController(this);
  }

  /** Text of the live region that screen readers announce; empty without an announcement. */
  get text(): string {
    return this.#text;
  }

  hostConnected(): void {
    this.#host.addEventListener('focusin', this.#onFocus);
    this.#host.addEventListener('focusout', this.#onBlur);
  }

  hostDisconnected(): void {
    this.#host.removeEventListener('focusin', this.#onFocus);
    this.#host.removeEventListener('focusout', this.#onBlur);
    clearTimeout(this.#timer);
    this.#timer = undefined;
  }

  /**
   * Call when the camera has moved. Announces the new side of the view after {@link INTERVAL_MS}, if it differs from
   * the last announced one.
   */
  cameraMoved(): void {
    if (this.isQuiet || this.#timer !== undefined || !this.#of.isFocused) return;
    this.#timer = setTimeout(this.#speak, INTERVAL_MS);
  }

  readonly #speak = (): void => {
    this.#timer = undefined;
    const name = this.#of.viewName;
    if (!this.#of.isFocused || name === this.#spoken) return;
    this.#spoken = name;
    this.say(this.#of.core.strings[name] ?? `View from ${name.replace('-', ' ')}`);
  };

  /** Screen readers read the name and the keys of the frame on focus, so only later moves are announced. */
  readonly #onFocus = (): void => {
    this.#spoken = this.#of.viewName;
  };

  readonly #onBlur = (): void => {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.say('');
  };

  /** Writes a sentence to the live region, which screen readers then announce; an empty one clears it. */
  say(text: string): void {
    if (text === this.#text) return;
    this.#text = text;
    this.#host.requestUpdate();
  }
}
