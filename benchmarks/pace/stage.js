/** Visible elements of a page, stacked, so that all of them draw: their size, their number, their cameras. */

/** Seconds that a scene may take to load. */
const LOADING_SECONDS = 120;
const PHI = '75deg';

export class Stage {
  #box;
  #elements = [];
  #shown = 1;
  #angle = 0;
  #size = { width: 0, height: 0 };

  /** @param plan see readPlan; the address of the scene may be another one. */
  constructor(box, url, { attributes, distance }, count) {
    this.#box = box;
    for (let i = 0; i < count; i++) {
      const element = document.createElement('gaussian-splat');
      Object.entries({ src: url, 'interpolation-decay': '0', ...attributes }).forEach(([name, value]) =>
        element.setAttribute(name, value),
      );
      this.#elements.push(element);
    }
    this.distance = distance;
  }

  /** Loads all scenes and shows the first. */
  async load() {
    this.#box.replaceChildren(...this.#elements);
    await Promise.all(this.#elements.map(loaded));
    this.show(1);
  }

  /** Budget of a frame in motion, ms on the GPU. */
  set frameBudget(milliseconds) {
    for (const element of this.#elements) element.frameBudget = milliseconds;
  }

  /** The visible elements. */
  get elements() {
    return this.#elements.slice(0, this.#shown);
  }

  get state() {
    return { elements: this.#shown, ...this.#size, distance: this.distance };
  }

  /** Shows the first `count` elements. */
  show(count) {
    if (count > this.#elements.length) throw new RangeError(`there are ${this.#elements.length} elements`);
    this.#shown = count;
    this.#elements.forEach((element, i) => (element.style.display = i < count ? 'block' : 'none'));
  }

  /** Device pixels. */
  resize(width, height) {
    this.#size = { width: Math.round(width), height: Math.round(height) };
    for (const { style } of this.#elements) {
      style.width = `${this.#size.width / devicePixelRatio}px`;
      style.height = `${this.#size.height / devicePixelRatio}px`;
    }
  }

  /** Turns all cameras. */
  turn(degrees) {
    this.#angle += degrees;
    for (const element of this.elements) {
      element.cameraOrbit = `${this.#angle.toFixed(4)}deg ${PHI} ${(100 * this.distance).toFixed(3)}%`;
      element.jumpCameraToGoal();
    }
  }
}

function loaded(element) {
  return new Promise((resolve, reject) => {
    const fail = (text) => reject(new Error(`the scene did not load: ${text}`));
    const timer = setTimeout(() => fail(`waited ${LOADING_SECONDS} s`), 1000 * LOADING_SECONDS);
    element.addEventListener('load', () => resolve(clearTimeout(timer)), { once: true });
    element.addEventListener('error', ({ detail }) => fail(detail?.message ?? 'error'), { once: true });
  });
}
