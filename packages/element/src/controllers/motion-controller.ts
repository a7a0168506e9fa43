import type { ReactiveController, ReactiveControllerHost } from 'lit';
import type { PlaybackController } from './playback-controller.js';

/** Something that moves the camera by itself, frame by frame. */
export interface Mover {
  /**
   * Moves on to the moment of a frame.
   * @param now requestAnimationFrame's clock, ms.
   * @returns whether it wants another frame.
   */
  advance(now: number): boolean;
}

/** Longest step of such a motion, ms: after a pause of the picture it goes on from where it was. */
export const MAX_MOVER_STEP_MS = 100;

/** True for people who have asked their system for less motion. */
export const prefersReducedMotion = (): boolean => reducedMotion().matches;

/** The system's wish for less motion, for those who want to know when it comes or goes; documents of unit tests (jsdom) know of none. */
export const reducedMotion = (): MediaQueryList =>
  globalThis.matchMedia?.('(prefers-reduced-motion: reduce)') ?? new EventTarget();

export interface MotionHost {
  /** The page asks the camera to turn by itself. */
  readonly autoRotates: boolean;
  /** There is a picture to be seen that could move. */
  readonly isOnShow: boolean;
  /** What the page asks to play by itself; undefined for nothing. */
  readonly player: Pick<PlaybackController, 'canPlay' | 'paused' | 'play' | 'pause'> | undefined;
  /** Lets the camera turn at once. */
  startTurning(): void;
}

/**
 * The visitor's say in what moves without their doing: a camera that turns, a scene that plays by itself. Moving content needs a way to stop it
 * (WCAG 2.2.2), also for those who have neither a keyboard nor the system's wish for less motion. What a script plays is the page's own.
 */
export class MotionController implements ReactiveController {
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #of: MotionHost;
  #isHeld = false;

  constructor(host: ReactiveControllerHost & HTMLElement, of: MotionHost) {
    this.#host = host;
    this.#of = of;
    host.addController(this);
  }

  /** A visitor has stopped what moves by itself. */
  get isHeld(): boolean {
    return this.#isHeld;
  }

  /** What the visitor's switch does now; `none` where nothing moves by itself, and in a player, which has a button of its own. */
  get switch(): 'none' | 'pause' | 'play' {
    if (!this.#of.isOnShow || this.#host.slot === 'media' || !(this.#canTurn || this.#canPlay)) return 'none';
    const isPlaying = this.#canPlay && !this.#of.player!.paused;
    return isPlaying || (this.#canTurn && !this.#isHeld) ? 'pause' : 'play';
  }

  /** The visitor stops all that moves by itself, or lets it move again; false if there is nothing. */
  toggle(): boolean {
    const action = this.switch;
    if (action === 'none') return false;
    this.#isHeld = action === 'pause';
    if (this.#canPlay) this.#of.player![action]();
    if (action === 'play') this.#of.startTurning();
    this.#host.requestUpdate();
    return true;
  }

  /** Attributes that are taken away and set again are the page's word, later than the visitor's. */
  hostUpdated(): void {
    if (!this.#of.autoRotates && !this.#of.player) this.#isHeld = false;
  }

  get #canTurn(): boolean {
    return this.#of.autoRotates && !prefersReducedMotion();
  }

  /** Also for people who want less motion, for whom nothing plays by itself: they may want this. */
  get #canPlay(): boolean {
    return this.#of.player?.canPlay ?? false;
  }
}
