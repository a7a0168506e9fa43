import type { ReactiveController } from 'lit';
import type { Announcer } from '../../viewer/announcer.js';
import { viewName, type ViewName } from '../../viewer/camera/spoken.js';
import type { Viewer } from '../../viewer/viewer.js';

/** Minimum interval between two announcements, ms, because a screen reader that is always interrupted says nothing. */
const INTERVAL_MS = 700;

/**
 * Announces the side from which the camera views the scene, for visitors who move the camera by keyboard and cannot see
 * the frame. Speaks only while the frame has keyboard focus, and at a limited rate.
 */
export class AnnouncerController implements ReactiveController, Announcer {
  readonly #viewer: Viewer;
  isQuiet = false;
  #text = '';
  #spoken: ViewName | undefined;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    viewer.element.addController(this);
  }

  get #viewName(): ViewName {
    const { theta, phi } = this.#viewer.camera.orbit;
    return viewName(theta, phi);
  }

  /** Whether the frame has the focus and the view has sides; in flight it has none. */
  get #isFocused(): boolean {
    const { attributes, surface } = this.#viewer;
    return attributes.navigation === 'orbit' && (surface?.matches(':focus') ?? false);
  }

  get text(): string {
    return this.#text;
  }

  hostConnected(): void {
    this.#viewer.element.addEventListener('focusin', this.#onFocus);
    this.#viewer.element.addEventListener('focusout', this.#onBlur);
  }

  hostDisconnected(): void {
    this.#viewer.element.removeEventListener('focusin', this.#onFocus);
    this.#viewer.element.removeEventListener('focusout', this.#onBlur);
    clearTimeout(this.#timer);
    this.#timer = undefined;
  }

  /**
   * Call when the camera has moved. Announces the new side of the view after {@link INTERVAL_MS}, if it differs from
   * the last announced one.
   */
  cameraMoved(): void {
    if (this.isQuiet || this.#timer !== undefined || !this.#isFocused) return;
    this.#timer = setTimeout(this.#speak, INTERVAL_MS);
  }

  readonly #speak = (): void => {
    this.#timer = undefined;
    const name = this.#viewName;
    if (!this.#isFocused || name === this.#spoken) return;
    this.#spoken = name;
    this.say(this.#viewer.strings[name] ?? `View from ${name.replace('-', ' ')}`);
  };

  /** Screen readers read the name and the keys of the frame on focus, so only later moves are announced. */
  readonly #onFocus = (): void => {
    this.#spoken = this.#viewName;
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
    this.#viewer.element.requestUpdate();
  }
}
