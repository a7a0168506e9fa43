/** Deflection of a stick, 0..1, below which it is ignored. */
const DEAD_ZONE = 0.15;

/** Sticks of the connected gamepads: the left one walks, the right one turns. */
export class Gamepads {
  readonly #view: Window | null;
  readonly #onDeflected: () => void;
  #signal: AbortSignal | undefined;
  /** Handle of the animation frame that reads next; 0 while none is requested. */
  #frame = 0;

  /** @param onDeflected Called in each animation frame in which a stick is deflected. */
  constructor(view: Window | null, onDeflected: () => void) {
    this.#view = view;
    this.#onDeflected = onDeflected;
  }

  /** Reads gamepads in every animation frame while one is connected, until the signal is aborted. */
  listen(signal: AbortSignal): void {
    this.#signal = signal;
    this.#view?.addEventListener('gamepadconnected', this.#start, { signal });
    if (this.#pads.some(Boolean)) this.#start();
  }

  /** The gamepads of the browser; none if the page's permissions policy forbids them. */
  get #pads(): readonly (Gamepad | null)[] {
    try {
      return this.#view?.navigator.getGamepads?.() ?? [];
    } catch {
      return [];
    }
  }

  /** Sum of the deflections of all gamepads. Each is -1..1. */
  get deflection(): readonly [right: number, forward: number, turn: number] {
    const beyond = (value = 0): number => (Math.abs(value) > DEAD_ZONE ? value : 0);
    let [right, forward, turn] = [0, 0, 0];
    for (const pad of this.#frame === 0 ? [] : this.#pads) {
      if (pad === null) continue;
      right += beyond(pad.axes[0]);
      forward -= beyond(pad.axes[1]);
      // This axis may be a trigger, which rests at -1, if the gamepad has no standard mapping.
      if (pad.mapping !== '') turn -= beyond(pad.axes[2]);
    }
    return [right, forward, turn];
  }

  readonly #start = (): void => {
    if (this.#frame === 0) this.#frame = this.#view!.requestAnimationFrame(this.#poll);
  };

  readonly #poll = (): void => {
    const goesOn = !this.#signal?.aborted && this.#pads.some(Boolean);
    this.#frame = goesOn ? this.#view!.requestAnimationFrame(this.#poll) : 0;
    if (this.deflection.some((value) => value !== 0)) this.#onDeflected();
  };
}
