import type { XrInput, XrInputEvent, XrSession } from './webxr.js';

/** Index of the button B or Y in the mapping `xr-standard`. */
const LEAVE = 5;
/** Seconds for which the button, or the pinch of both hands, must be held. */
const [BUTTON_SECONDS, HANDS_SECONDS] = [1, 2];

/** The inputs of a session that select, and the gestures that end it in a headset. */
export class Leaving {
  readonly #session: XrSession;
  /** Hands, which report no buttons, that pinch. */
  readonly #pinching = new Set<XrInput>();
  #seconds = 0;
  /** Whether both hands pinch, or have not been opened since. Such a pinch aims at nothing. */
  isGesture = false;

  constructor(session: XrSession, signal: AbortSignal) {
    this.#session = session;
    const listen = (type: 'selectstart' | 'selectend', react: (input: XrInput) => void): void =>
      session.addEventListener(type, (event) => react((event as XrInputEvent).inputSource), { signal });
    listen('selectstart', (input) => isHand(input) && this.#pinching.add(input));
    listen('selectend', (input) => this.#pinching.delete(input));
  }

  /** Advances to a frame, and ends the session if its visitor wants to leave. */
  advance(seconds: number): void {
    const hands = this.#pinching.size;
    this.isGesture = hands > 1 || (this.isGesture && hands > 0);
    const isPressed = [...this.#session.inputSources].some(({ gamepad }) => gamepad?.buttons[LEAVE]?.pressed);
    this.#seconds = isPressed || hands > 1 ? this.#seconds + seconds : 0;
    if (this.#seconds < (isPressed ? BUTTON_SECONDS : HANDS_SECONDS)) return;
    this.#seconds = -Infinity;
    void this.#session.end().catch(() => undefined);
  }
}

/** Whether an input is a hand. Fingers on a screen pinch to scale what they touch. */
const isHand = ({ gamepad, targetRayMode }: XrInput): boolean =>
  gamepad?.buttons[0] === undefined && targetRayMode !== 'screen';
