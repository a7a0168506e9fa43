/** Delay of the first preview after the start of the load, ms. Shorter downloads need no preview. */
const FIRST_AFTER_MS = 300;
/** Minimum remaining time of the load for which a preview is shown, ms. */
const MIN_REST_MS = 500;
/** Growth of the received part from one preview to the next. */
const GROWTH = 2;
/** Maximum fraction of the loading time that previews may take. */
const MAX_SHARE = 0.05;

/** Decides when a preview of a scene is shown whose splats are packed while they arrive. */
export class PreviewTimes {
  readonly #start = performance.now();
  #spentMs = 0;
  #due = 0;

  /** @param share Received part of the scene, 0..1. */
  isDue(share: number): boolean {
    const elapsed = performance.now() - this.#start;
    if (elapsed < FIRST_AFTER_MS || share < this.#due || this.#spentMs > MAX_SHARE * elapsed) return false;
    if (elapsed * (1 - share) < MIN_REST_MS * share) return false;
    this.#due = GROWTH * share;
    return true;
  }

  take(show: () => void): void {
    const began = performance.now();
    show();
    this.#spentMs += performance.now() - began;
  }
}
