/** The visitor's control of automatic motion. The module is loaded when an element has automatic motion. */
import { css, type ReactiveController, type ReactiveControllerHost, type TemplateResult } from 'lit';
import type { Attributes } from '../../viewer/attributes.js';
import { CORNER_STYLES, cornerButton } from '../../viewer/corner-button.js';
import { adoptStyles } from '../../viewer/styles.js';
import type { A11yStrings } from '../../viewer/strings.js';
import { prefersReducedMotion } from '../../viewer/motion.js';
import type { PlaybackController } from '../../viewer/playback-controller.js';

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

/** Labels of the button, and SVG paths of its icons. */
const SIGNS = {
  pause: ['Pause', 'M6 5h4v14H6zM14 5h4v14h-4z'],
  play: ['Start the motion', 'M8 5v14l11-7z'],
} as const;

/** The part of the element that the control of automatic motion uses. */
export interface MotionCore {
  readonly attributes: Pick<Attributes, 'autoRotate'>;
  /** Whether the scene is shown: in the viewport, and not covered by a poster. */
  readonly isOnShow: boolean;
  /** Plays and pauses all sources with `autoplay`, and an animated shader. Undefined if there are neither. */
  readonly player: Pick<PlaybackController, 'canPlay' | 'paused' | 'play' | 'pause'> | undefined;
  readonly strings: A11yStrings;
}

export interface MotionHost {
  readonly core: MotionCore;
  /** The automatic rotation of the camera; its `value` is undefined until its code is loaded. */
  readonly autoRotate: { readonly value: { start(): void } | undefined };
}

/**
 * The visitor's control of automatic motion, which is a rotating camera or a playing scene. WCAG 2.2.2 requires a way
 * to stop motion, also for visitors without a keyboard or the reduced-motion setting. Playback that scripts start is
 * left to the page.
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

  /** Whether a visitor has stopped automatic motion. */
  get isHeld(): boolean {
    return this.#isHeld;
  }

  /**
   * Action of the visitor's button. It is `none` without automatic motion, and in a media player, which has its own
   * button.
   */
  get switch(): 'none' | 'pause' | 'play' {
    if (!this.#of.core.isOnShow || this.#host.slot === 'media' || !(this.#canTurn || this.#canPlay)) return 'none';
    const isPlaying = this.#canPlay && !this.#of.core.player!.paused;
    return isPlaying || (this.#canTurn && !this.#isHeld) ? 'pause' : 'play';
  }

  /** Template of the visitor's button; undefined if there is nothing to switch. */
  get view(): TemplateResult | undefined {
    const action = this.switch;
    if (action === 'none') return undefined;
    const { strings } = this.#of.core;
    const [word, sign] = SIGNS[action];
    return cornerButton('pause-button', strings[action] ?? word, sign, () => this.toggle(), strings);
  }

  /** Stops or resumes all automatic motion for the visitor. Returns false if there is no automatic motion. */
  toggle(): boolean {
    const action = this.switch;
    if (action === 'none') return false;
    this.#isHeld = action === 'pause';
    if (this.#canPlay) this.#of.core.player![action]();
    if (action === 'play') this.#of.autoRotate.value?.start();
    this.#host.requestUpdate();
    return true;
  }

  /** Forgets the visitor's choice when the page removes the attributes of automatic motion. */
  hostUpdated(): void {
    if (!this.#of.core.attributes.autoRotate && !this.#of.core.player) this.#isHeld = false;
  }

  get #canTurn(): boolean {
    return this.#of.core.attributes.autoRotate && !prefersReducedMotion();
  }

  /** Whether the scene can be played; also with reduced motion, because the visitor may want to play it. */
  get #canPlay(): boolean {
    return this.#of.core.player?.canPlay ?? false;
  }
}
