import type { ReactiveController, ReactiveControllerHost } from 'lit';
import type { PlaybackController } from './playback-controller.js';

export interface MotionOptions {
  /** The page asks the camera to turn by itself. */
  readonly rotates: () => boolean;
  /** The page asks a scene that moves to play by itself. */
  readonly autoplays: () => boolean;
  /** There is a picture to be seen that could move. */
  readonly isOnShow: () => boolean;
  readonly prefersReducedMotion: () => boolean;
  readonly playback: Pick<PlaybackController, 'canPlay' | 'paused' | 'play' | 'pause'>;
  /** Lets the camera turn at once. */
  readonly startTurning: () => void;
}

/**
 * The visitor's say in what moves without their doing: a camera that turns, a scene that plays by itself. Moving content needs a way to stop it
 * (WCAG 2.2.2), also for those who have neither a keyboard nor the system's wish for less motion. What a script plays is the page's own.
 */
export class MotionController implements ReactiveController {
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #options: MotionOptions;
  #isHeld = false;

  constructor(host: ReactiveControllerHost & HTMLElement, options: MotionOptions) {
    this.#host = host;
    this.#options = options;
    host.addController(this);
  }

  /** A visitor has stopped what moves by itself. */
  get isHeld(): boolean {
    return this.#isHeld;
  }

  /** What the visitor's switch does now; `none` where nothing moves by itself, and in a player, which has a button of its own. */
  get switch(): 'none' | 'pause' | 'play' {
    if (!this.#options.isOnShow() || this.#host.slot === 'media' || !(this.#canTurn || this.#canPlay)) return 'none';
    const isPlaying = this.#canPlay && !this.#options.playback.paused;
    return isPlaying || (this.#canTurn && !this.#isHeld) ? 'pause' : 'play';
  }

  /** The visitor stops all that moves by itself, or lets it move again; false if there is nothing. */
  toggle(): boolean {
    const action = this.switch;
    if (action === 'none') return false;
    this.#isHeld = action === 'pause';
    const { playback, startTurning } = this.#options;
    if (this.#canPlay) playback[action]();
    if (action === 'play') startTurning();
    this.#host.requestUpdate();
    return true;
  }

  /** Attributes that are taken away and set again are the page's word, later than the visitor's. */
  hostUpdated(): void {
    const { rotates, autoplays } = this.#options;
    if (!rotates() && !autoplays()) this.#isHeld = false;
  }

  get #canTurn(): boolean {
    return this.#options.rotates() && !this.#options.prefersReducedMotion();
  }

  /** Also for people who want less motion, for whom nothing plays by itself: they may want this. */
  get #canPlay(): boolean {
    return this.#options.autoplays() && this.#options.playback.canPlay;
  }
}
