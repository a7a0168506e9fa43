import type { ReactiveController } from 'lit';
import { prefersReducedMotion } from '../../viewer/motion.js';
import type { Viewer } from '../../viewer/viewer.js';

/** Amplitude of the swing, radians. */
const WIGGLE_ANGLE = Math.PI / 18;
/**
 * Duration of the two full swings, ms; then the camera is still. WCAG 2.2.2 requires a control to stop motion only from
 * 5 s.
 */
const WIGGLE_MS = 4_500;
/** Time after which the prompt counts as seen and is hidden, ms. */
const SHOWN_MS = 5_000;

/** Returns the rotation of the camera at a time of the swing, radians; 0 at its start, at its end and outside. */
export function wiggleAt(elapsedMs: number): number {
  if (elapsedMs <= 0 || elapsedMs >= WIGGLE_MS) return 0;
  const share = elapsedMs / WIGGLE_MS;
  return WIGGLE_ANGLE * Math.sin(4 * Math.PI * share) * Math.sin(Math.PI * share);
}

/** Shows a prompt to visitors who have not moved the camera yet: that they can move it. */
export class PromptController implements ReactiveController {
  /** The controller whose element has shown the page's prompt: other elements of the page need none. */
  static #prompter: PromptController | undefined;
  readonly #viewer: Viewer;
  #state: 'idle' | 'waiting' | 'shown' | 'done' = 'idle';
  #timer: ReturnType<typeof setTimeout> | undefined;
  #start: number | undefined;
  #turned = 0;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    viewer.element.addController(this);
  }

  /**
   * Whether the prompt swings the camera: only if the page selects it and the visitor does not prefer reduced motion.
   */
  get wiggles(): boolean {
    return this.#viewer.attributes.interactionPromptStyle === 'wiggle' && !prefersReducedMotion();
  }

  get isShown(): boolean {
    return this.#state === 'shown';
  }

  hostUpdated(): void {
    const { input, attributes, isOnShow } = this.#viewer;
    const mayShow = input.enabled && attributes.interactionPrompt === 'auto' && isOnShow;
    if (mayShow && this.#state === 'idle') this.#wait();
    else if (!mayShow && (this.#state === 'waiting' || this.#state === 'shown')) this.reset();
  }

  hostDisconnected(): void {
    if (PromptController.#prompter === this) PromptController.#prompter = undefined;
    if (this.#state !== 'done') this.#set('idle');
  }

  /**
   * Hides the prompt until {@link reset}. Call when a visitor has moved the camera, or has seen the prompt long enough.
   */
  dismiss(): void {
    if (this.#state !== 'done') this.#set('done');
  }

  /** Returns to the initial state: the prompt is shown again after the threshold. */
  reset(): void {
    this.#set('idle');
  }

  advance(now: number): boolean {
    if (this.#state !== 'shown' || !this.wiggles) return false;
    this.#start ??= now;
    const elapsed = now - this.#start;
    const turned = wiggleAt(elapsed);
    if (turned !== this.#turned) this.#turned += this.#viewer.camera.turnBy(turned - this.#turned);
    return elapsed < WIGGLE_MS;
  }

  #wait(): void {
    this.#state = 'waiting';
    this.#timer = setTimeout(() => {
      PromptController.#prompter ??= this;
      if (PromptController.#prompter !== this) return this.#set('done');
      this.#start = undefined;
      this.#turned = 0;
      this.#set('shown');
      this.#timer = setTimeout(() => this.dismiss(), SHOWN_MS);
      if (this.wiggles) this.#viewer.requestFrame();
    }, this.#viewer.attributes.interactionPromptThreshold);
  }

  #set(state: 'idle' | 'shown' | 'done'): void {
    clearTimeout(this.#timer);
    const changed = state !== this.#state;
    this.#state = state;
    if (changed) this.#viewer.element.requestUpdate();
  }
}
