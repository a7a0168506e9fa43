/** Loaded when something moves by itself. */
import { css, type ReactiveController, type ReactiveControllerHost, type TemplateResult } from 'lit';
import type { Attributes } from '../attributes.js';
import { CORNER_STYLES, cornerButton } from '../corner-button.js';
import { adoptStyles } from '../styles.js';
import type { SpokenStrings } from '../words.js';
import { prefersReducedMotion } from './motion.js';
import type { PlaybackController } from './playback-controller.js';

const STYLES = css`
  [part='pause-button'] {
    display: var(--pause-button-display, block);
  }
  @media (hover: hover) {
    :host(:not(:hover, :focus-within)) [part='pause-button'] {
      opacity: 0;
    }
  }
`;

/** What the switch says, and its sign. */
const SIGNS = {
  pause: ['Stop the motion', 'M6 5h4v14H6zM14 5h4v14h-4z'],
  play: ['Start the motion', 'M8 5v14l11-7z'],
} as const;

export interface MotionHost {
  readonly attributes: Pick<Attributes, 'autoRotate'>;
  /** There is a picture to be seen that could move. */
  readonly isOnShow: boolean;
  /** What the page asks to play by itself; undefined for nothing. */
  readonly player: Pick<PlaybackController, 'canPlay' | 'paused' | 'play' | 'pause'> | undefined;
  readonly strings: SpokenStrings;
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
    adoptStyles(host.shadowRoot!, CORNER_STYLES, STYLES);
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

  /** The visitor's switch; undefined where nothing moves by itself. */
  get view(): TemplateResult | undefined {
    const action = this.switch;
    if (action === 'none') return undefined;
    const { strings } = this.#of;
    const [word, sign] = SIGNS[action];
    return cornerButton('pause-button', strings[action] ?? word, sign, () => this.toggle(), strings);
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
    if (!this.#of.attributes.autoRotate && !this.#of.player) this.#isHeld = false;
  }

  get #canTurn(): boolean {
    return this.#of.attributes.autoRotate && !prefersReducedMotion();
  }

  /** Also for people who want less motion, for whom nothing plays by itself: they may want this. */
  get #canPlay(): boolean {
    return this.#of.player?.canPlay ?? false;
  }
}
