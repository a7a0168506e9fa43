import type { ReactiveController, ReactiveControllerHost } from 'lit';
import { viewSentence, type ViewName } from '../camera/spoken.js';
import type { SpokenStrings } from '../words.js';

export interface AnnouncerHost {
  readonly viewName: ViewName;
  readonly strings: SpokenStrings;
  /** True while a person has the keyboard on the picture. */
  readonly isFocused: boolean;
}

/** Least time between two announcements, ms: a screen reader that is interrupted all the time says nothing. */
const INTERVAL_MS = 700;

/** Says where the camera has gone, to people who move it by keyboard and cannot see it: while it has the focus, and not too often. */
export class AnnouncerController implements ReactiveController {
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #of: AnnouncerHost;
  /** A flight says itself where it has gone. */
  isQuiet = false;
  #text = '';
  #spoken: ViewName | undefined;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(host: ReactiveControllerHost & HTMLElement, of: AnnouncerHost) {
    this.#host = host;
    this.#of = of;
    host.addController(this);
  }

  /** What the live region holds. */
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

  /** The camera is somewhere else. */
  cameraMoved(): void {
    if (this.isQuiet || this.#timer !== undefined || !this.#of.isFocused) return;
    this.#timer = setTimeout(this.#speak, INTERVAL_MS);
  }

  readonly #speak = (): void => {
    this.#timer = undefined;
    const name = this.#of.viewName;
    if (!this.#of.isFocused || name === this.#spoken) return;
    this.#spoken = name;
    this.say(viewSentence(name, this.#of.strings));
  };

  /** The picture's name and keys are read on focus; only moves are news. */
  readonly #onFocus = (): void => {
    this.#spoken = this.#of.viewName;
  };

  readonly #onBlur = (): void => {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.say('');
  };

  /** Puts a sentence into the live region. */
  say(text: string): void {
    if (text === this.#text) return;
    this.#text = text;
    this.#host.requestUpdate();
  }
}
