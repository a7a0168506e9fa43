/**
 * Joystick for the left thumb, shown on touch screens in the lower left corner of the scene, above the row of buttons.
 * Its values are -1..1.
 */
export class Joystick {
  readonly element: HTMLElement;
  readonly #knob: HTMLElement;
  readonly #onChange: () => void;
  #pointer: number | undefined;
  /** Deflection to the right. */
  right = 0;
  forward = 0;

  constructor(document: Document, onChange: () => void) {
    this.#onChange = onChange;
    this.element = document.createElement('div');
    this.#knob = document.createElement('div');
    this.element.setAttribute('part', 'joystick');
    // Screen readers ignore the joystick, because their users have the arrow keys.
    this.element.setAttribute('aria-hidden', 'true');
    Object.assign(this.element.style, {
      ...{ position: 'absolute', left: '16px', bottom: '60px', width: '96px', height: '96px', borderRadius: '50%' },
      ...{ background: 'rgb(0 0 0 / 25%)', border: '2px solid rgb(255 255 255 / 60%)', boxSizing: 'border-box' },
      ...{ touchAction: 'none', display: 'none', zIndex: '1' },
    });
    Object.assign(this.#knob.style, {
      ...{ position: 'absolute', left: '28px', top: '28px', width: '36px', height: '36px', borderRadius: '50%' },
      ...{ background: 'rgb(255 255 255 / 80%)', pointerEvents: 'none' },
    });
    this.element.append(this.#knob);
    this.element.addEventListener('pointerdown', this.#onDown);
    this.element.addEventListener('pointermove', this.#onMove);
    for (const type of ['pointerup', 'pointercancel', 'lostpointercapture'] as const)
      this.element.addEventListener(type, this.#onUp);
  }

  set isShown(isShown: boolean) {
    this.element.style.display = isShown ? 'block' : 'none';
  }

  readonly #onDown = (event: PointerEvent): void => {
    this.#pointer = event.pointerId;
    event.preventDefault();
    try {
      this.element.setPointerCapture(event.pointerId);
    } catch {
      // The pointer has left the page, or a script has dispatched the event.
    }
    this.#onMove(event);
  };

  readonly #onMove = (event: PointerEvent): void => {
    if (event.pointerId !== this.#pointer) return;
    const { left, top, width, height } = this.element.getBoundingClientRect();
    const x = (2 * (event.clientX - left)) / width - 1;
    const y = (2 * (event.clientY - top)) / height - 1;
    const length = Math.max(1, Math.hypot(x, y));
    this.#set(x / length, -y / length);
  };

  readonly #onUp = (event: PointerEvent): void => {
    if (event.pointerId === this.#pointer) this.#release();
  };

  /** Removes the joystick from the page. A thumb on it is then not reported to it any more. */
  remove(): void {
    this.element.remove();
    if (this.#pointer !== undefined) this.#release();
  }

  #release(): void {
    this.#pointer = undefined;
    this.#set(0, 0);
  }

  #set(right: number, forward: number): void {
    [this.right, this.forward] = [right, forward];
    this.#knob.style.transform = `translate(${28 * right}px, ${-28 * forward}px)`;
    this.#onChange();
  }
}
