import { Lazy, type Vector3 } from '@gaussian-splat/core';
import type { ReactiveControllerHost } from 'lit';
import type { Attributes } from './attributes.js';
import type { CameraAction } from './camera/gestures.js';
import { viewName, type ViewName } from './camera/spoken.js';
import type { A11yStrings } from './words.js';
import type { AnnouncerController, AnnouncerHost } from './controllers/announcer-controller.js';
import type { AutoRotateHost } from './controllers/auto-rotate-controller.js';
import type { CameraController } from './controllers/camera-controller.js';
import type { FlyHost } from './controllers/fly-controller.js';
import type { InputOptions } from './controllers/input-controller.js';
import type { MotionController, MotionHost } from './controllers/motion-controller.js';
import { prefersReducedMotion, reducedMotion, type Mover } from './controllers/motion.js';
import type { PromptController, PromptHost } from './controllers/prompt-controller.js';

/** Interface of the element for behaviors. */
export interface BehaviorHost extends Omit<MotionHost, 'startTurning'> {
  readonly attributes: Attributes;
  readonly camera: CameraController;
  readonly input: InputOptions;
  readonly strings: A11yStrings;
  readonly surface: HTMLElement | null;
  /** The walk controller, once it is loaded. */
  readonly walk: { readonly value: { readonly isRefused: boolean; ahead(meters: number): void } | undefined };
  requestFrame(): void;
  warn(sentence: string): void;
}

/** Camera behaviors besides direct input: auto-rotation, prompt, flying, announcements. */
export class Behaviors implements AutoRotateHost, PromptHost, FlyHost, AnnouncerHost, MotionHost {
  /** Created with the camera controls. */
  prompt: PromptController | undefined;
  readonly #host: BehaviorHost;
  readonly #element: ReactiveControllerHost;
  readonly #movers: Mover[] = [];

  // Loaded on demand, because few pages need these.

  /** Announces the view to screen readers. */
  readonly announcer: Lazy<AnnouncerController>;
  /** The visitor's switch for automatic motion. */
  readonly motion: Lazy<MotionController>;
  readonly #autoRotate = new Lazy('the code that turns the camera', async () => {
    const { AutoRotateController } = await import('./controllers/auto-rotate-controller.js');
    return this.#added(new AutoRotateController(this.#element, this));
  });
  readonly #fly = new Lazy('the code that flies by keyboard', async () => {
    const { FlyController } = await import('./controllers/fly-controller.js');
    return this.#added(new FlyController(this.#element, this));
  });

  constructor(element: ReactiveControllerHost & HTMLElement, host: BehaviorHost) {
    this.#host = host;
    this.#element = element;
    this.motion = new Lazy(
      'the code of the switch for motion',
      async () => {
        const { MotionController } = await import('./controllers/motion-controller.js');
        return new MotionController(element, this);
      },
      () => element.requestUpdate(),
    );
    this.announcer = new Lazy('the code that speaks of the view', async () => {
      const { AnnouncerController } = await import('./controllers/input-controller.js');
      return new AnnouncerController(element, this);
    });
    let motion: MediaQueryList | undefined;
    const onMotion = (): void => element.requestUpdate();
    element.addController({
      hostUpdated: () => {
        this.camera.pivot = this.#flies ? 'eye' : 'target';
        if (this.mayFly) this.#fly.want(this.#warnOf);
        if (this.attributes.autoRotate) this.#autoRotate.want(this.#warnOf);
        if (this.attributes.autoRotate || this.player) this.motion.want(this.#warnOf);
      },
      hostConnected: () => {
        // Also when the focus moves from the frame to the button inside.
        element.shadowRoot?.addEventListener('focusout', this.#onBlur);
        motion = reducedMotion();
        motion.addEventListener('change', onMotion);
      },
      hostDisconnected: () => {
        element.shadowRoot?.removeEventListener('focusout', this.#onBlur);
        motion?.removeEventListener('change', onMotion);
      },
    });
  }

  get attributes(): Attributes {
    return this.#host.attributes;
  }

  get camera(): CameraController {
    return this.#host.camera;
  }

  get surface(): HTMLElement | null {
    return this.#host.surface;
  }

  get strings(): A11yStrings {
    return this.#host.strings;
  }

  get player(): MotionHost['player'] {
    return this.#host.player;
  }

  get isOnShow(): boolean {
    return this.#host.isOnShow;
  }

  get viewName(): ViewName {
    const { theta, phi } = this.camera.orbit;
    return viewName(theta, phi);
  }

  /** While flying, the view has no named side. */
  get isFocused(): boolean {
    return !this.#flies && (this.surface?.matches(':focus') ?? false);
  }

  get mayTurn(): boolean {
    const mayMove = this.isOnShow && !prefersReducedMotion() && !this.motion.value?.isHeld;
    return this.attributes.autoRotate && mayMove && !hasKeyboard(this.surface);
  }

  get mayPrompt(): boolean {
    return this.#host.input.enabled && this.attributes.interactionPrompt === 'auto' && this.isOnShow;
  }

  get mayFly(): boolean {
    return this.#host.input.enabled && this.#flies && !this.#walks;
  }

  requestFrame(): void {
    this.#host.requestFrame();
  }

  startTurning(): void {
    this.#autoRotate.value?.start();
  }

  flyBy(right: number, up: number, forward: number): void {
    this.#touched();
    this.camera.moveBy(right, up, forward);
  }

  /** The prompt swings the camera only for visitors without reduced motion. */
  get promptWiggles(): boolean {
    return this.attributes.interactionPromptStyle === 'wiggle' && !prefersReducedMotion();
  }

  /** Whether the camera stays on the floor; until one is found it does not move, and without one it flies. */
  get #walks(): boolean {
    return this.attributes.navigation === 'walk' && !this.#host.walk.value?.isRefused;
  }

  get #flies(): boolean {
    return this.attributes.navigation !== 'orbit';
  }

  promptBy(prompt: PromptController): void {
    this.prompt = this.#added(prompt);
  }

  /** Adds another automatic motion of the camera. */
  add(mover: Mover): void {
    this.#movers.push(mover);
  }

  #added<T extends Mover>(mover: T): T {
    this.add(mover);
    this.#element.requestUpdate();
    return mover;
  }

  readonly #warnOf = ({ message }: Error): void => this.#host.warn(message);

  /** Restarts the delay of auto-rotation. */
  rest(): void {
    this.#autoRotate.value?.rest();
  }

  /** Advances automatic motions to a frame. */
  advance(now: number): void {
    for (const mover of this.#movers) if (mover.advance(now)) this.requestFrame();
  }

  /** Applies a visitor's gesture or key. @returns False if it has no effect, at the limit of the zoom. */
  act(action: CameraAction): boolean {
    const camera = this.camera;
    const { isTouched } = camera;
    this.#touched();
    let moves = true;
    if (action.type === 'reset') camera.reset('user-interaction');
    else if (action.type === 'pan') {
      if (!this.#walks) camera.panBy(action.right, action.up);
    } else if (this.#flies) this.#flyWith(action);
    else if (action.type === 'orbit') camera.orbitBy(action.theta, action.phi);
    else moves = camera.zoomBy(action.factor);
    // The reset button depends on this.
    if (camera.isTouched !== isTouched) this.#element.requestUpdate();
    return moves;
  }

  /** Sets the orbit target that a visitor picks, in viewer space. */
  aimAt(point: Vector3): void {
    this.#touched();
    this.camera.aimAt(point);
  }

  /** In flight the scene follows the pointer: a drag across the frame rotates the view by its field of view. */
  #flyWith(action: Extract<CameraAction, { type: 'orbit' | 'zoom' }>): void {
    const camera = this.camera;
    if (action.type === 'zoom') {
      const ahead = -Math.log(action.factor);
      if (this.#walks) return this.#host.walk.value?.ahead(WHEEL_METERS * ahead);
      return camera.moveBy(0, 0, ahead * camera.bounds.radius);
    }
    const share = camera.fieldOfView.radians / (2 * Math.PI);
    camera.lookBy(-share * action.theta, -share * action.phi);
  }

  #touched(): void {
    this.prompt?.dismiss();
    this.rest();
  }

  readonly #onBlur = (): void => this.rest();
}

/** Distance that a zoom by the factor e moves a walker, meters. */
const WHEEL_METERS = 2;

/** Whether the frame has keyboard focus, during which nothing may move automatically. */
const hasKeyboard = (surface: HTMLElement | null): boolean => surface?.matches(':focus-visible') ?? false;
