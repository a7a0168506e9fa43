/** The visitor's control of automatic motion. The module is loaded when an element has automatic motion. */
import { css, type ReactiveController, type TemplateResult } from 'lit';
import { CORNER_STYLES, cornerButton } from '../../viewer/corner-button.js';
import { adoptStyles } from '../../viewer/styles.js';
import { prefersReducedMotion } from '../../viewer/motion.js';
import type { Feature } from '../../viewer/features.js';
import type { Viewer } from '../../viewer/viewer.js';
import type { AutoRotateController } from './auto-rotate-controller.js';

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

/**
 * The visitor's control of automatic motion, which is a rotating camera or a playing scene. WCAG 2.2.2 requires a way
 * to stop motion, also for visitors without a keyboard or the reduced-motion setting. Playback that scripts start is
 * left to the page.
 */
export class MotionController implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  #isHeld = false;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    adoptStyles(viewer.element.shadowRoot!, CORNER_STYLES, STYLES);
    viewer.element.addController(this);
  }

  mayMove(): boolean {
    return !this.#isHeld;
  }

  /**
   * Action of the visitor's button. It is `none` without automatic motion, and in a media player, which has its own
   * button.
   */
  get switch(): 'none' | 'pause' | 'play' {
    if (!this.#viewer.isOnShow || this.#viewer.element.slot === 'media' || !(this.#canTurn || this.#canPlay))
      return 'none';
    const isPlaying = this.#canPlay && !this.#viewer.player!.paused;
    return isPlaying || (this.#canTurn && !this.#isHeld) ? 'pause' : 'play';
  }

  /** Template of the visitor's button; undefined if there is nothing to switch. */
  view(): TemplateResult | undefined {
    const action = this.switch;
    if (action === 'none') return undefined;
    const { strings } = this.#viewer;
    const [word, sign] = SIGNS[action];
    return cornerButton('pause-button', strings[action] ?? word, sign, () => this.toggleMotion(), strings);
  }

  toggleMotion(): true | undefined {
    const action = this.switch;
    if (action === 'none') return undefined;
    this.#isHeld = action === 'pause';
    if (this.#canPlay) this.#viewer.player![action]();
    if (action === 'play') this.#viewer.features.get<AutoRotateController>('autoRotate').value?.start();
    this.#viewer.element.requestUpdate();
    return true;
  }

  /** Forgets the visitor's choice when the page removes the attributes of automatic motion. */
  hostUpdated(): void {
    if (!this.#viewer.attributes.autoRotate && !this.#viewer.player) this.#isHeld = false;
  }

  get #canTurn(): boolean {
    return this.#viewer.attributes.autoRotate && !prefersReducedMotion();
  }

  /** Whether the scene can be played; also with reduced motion, because the visitor may want to play it. */
  get #canPlay(): boolean {
    return this.#viewer.player?.canPlay ?? false;
  }
}
