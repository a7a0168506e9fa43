import type { Lazy, Vector3 } from '@gaussian-splat/core';
import type { ReactiveControllerHost } from 'lit';
import type { Attributes } from './attributes.js';
import type { CameraAction } from './camera/gestures.js';
import { viewName, type ViewName } from './camera/spoken.js';
import type { AnnouncerController, AnnouncerHost } from '../features/input/announcer-controller.js';
import type { AutoRotateController, AutoRotateHost } from '../features/auto-rotate/auto-rotate-controller.js';
import type { CameraController } from './camera-controller.js';
import type { FlyHost } from '../features/flight/fly-controller.js';
import type { InputOptions } from '../features/input/input-controller.js';
import type { MotionController, MotionCore, MotionHost } from '../features/auto-rotate/motion-controller.js';
import { prefersReducedMotion, reducedMotion } from './motion.js';
import type { PromptController, PromptHost } from '../features/prompt/prompt-controller.js';
import type { Features } from './features.js';

/** The part of the element that {@link Behaviors} uses. */
export interface BehaviorHost extends MotionCore {
  readonly attributes: Attributes;
  readonly camera: CameraController;
  readonly input: InputOptions;
  readonly features: Features;
  /** Whether automatic motion is allowed. */
  readonly mayMove: boolean;
  readonly surface: HTMLElement | null;
  /** The walk controller; its `value` is undefined until its code is loaded. */
  readonly walk: { readonly value: { readonly isRefused: boolean; ahead(meters: number): void } | undefined };
  requestFrame(): void;
  warn(sentence: string): void;
}

/**
 * Camera behaviors besides direct input: auto-rotation, prompt, flight by keyboard, and announcements for screen
 * readers.
 */
export class Behaviors implements AutoRotateHost, PromptHost, FlyHost, AnnouncerHost, MotionHost {
  /** The interaction prompt; undefined until the code of the camera controls is loaded. */
  prompt: PromptController | undefined;
  readonly camera: CameraController;
  readonly core: BehaviorHost;
  readonly #element: ReactiveControllerHost;

  // The following code is loaded on demand, because few pages need it.

  /** Announces the view to screen readers. */
  readonly announcer: Lazy<AnnouncerController>;
  /** The button with which a visitor pauses automatic motion. */
  readonly motion: Lazy<MotionController>;
  readonly autoRotate: Lazy<AutoRotateController>;

  constructor(element: ReactiveControllerHost & HTMLElement, host: BehaviorHost) {
    this.core = host;
    this.camera = host.camera;
    this.#element = element;
    const { features } = host;
    this.autoRotate = features.add(
      'the code that turns the camera',
      { by: ({ autoRotate }) => autoRotate },
      async () =>
        new (await import('../features/auto-rotate/auto-rotate-controller.js')).AutoRotateController(element, this),
    );
    features.add(
      'the code that flies by keyboard',
      { by: () => this.mayFly },
      async () => new (await import('../features/flight/fly-controller.js')).FlyController(element, this),
    );
    this.motion = features.add(
      'the code of the switch for motion',
      { by: ({ autoRotate }) => autoRotate || host.player },
      async () => new (await import('../features/auto-rotate/motion-controller.js')).MotionController(element, this),
    );
    this.announcer = features.add(
      'the code that speaks of the view',
      {},
      async () => new (await import('../features/input/input-controller.js')).AnnouncerController(element, this),
    );
    let motion: MediaQueryList | undefined;
    const onMotion = (): void => element.requestUpdate();
    element.addController({
      hostUpdated: () => {
        this.camera.pivot = this.#flies ? 'eye' : 'target';
      },
      hostConnected: () => {
        // `focusout` is fired also when the focus moves from the frame to a button in the shadow tree.
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

  get viewName(): ViewName {
    const { theta, phi } = this.camera.orbit;
    return viewName(theta, phi);
  }

  /**
   * Whether the frame has the focus and an announcement may name the side of the view; false in flight, which has no
   * sides.
   */
  get isFocused(): boolean {
    return !this.#flies && (this.core.surface?.matches(':focus') ?? false);
  }

  get mayTurn(): boolean {
    const { attributes, mayMove, surface } = this.core;
    return attributes.autoRotate && mayMove && !hasKeyboard(surface);
  }

  get mayPrompt(): boolean {
    const { input, attributes, isOnShow } = this.core;
    return input.enabled && attributes.interactionPrompt === 'auto' && isOnShow;
  }

  get mayFly(): boolean {
    return this.core.input.enabled && this.#flies && !this.#walks;
  }

  flyBy(right: number, up: number, forward: number): void {
    this.#touched();
    this.camera.moveBy(right, up, forward);
  }

  /**
   * Whether the prompt swings the camera: only if the page selects it and the visitor does not prefer reduced motion.
   */
  get promptWiggles(): boolean {
    return this.core.attributes.interactionPromptStyle === 'wiggle' && !prefersReducedMotion();
  }

  /**
   * Whether the camera walks on the floor. It does not move until a floor is found, and it flies if the scene has none.
   */
  get #walks(): boolean {
    return this.core.attributes.navigation === 'walk' && !this.core.walk.value?.isRefused;
  }

  get #flies(): boolean {
    return this.core.attributes.navigation !== 'orbit';
  }

  promptBy(prompt: PromptController): void {
    this.prompt = this.core.features.use(prompt);
    this.#element.requestUpdate();
  }

  /** Restarts the delay after which auto-rotation begins. */
  rest(): void {
    this.autoRotate.value?.rest();
  }

  /** Advances all automatic motions to the time of a frame, `now` in milliseconds. */
  advance(now: number): void {
    if (this.core.features.call('advance', now).includes(true)) this.core.requestFrame();
  }

  /** Applies a visitor's gesture or key. @returns Whether it has an effect; false only for a zoom beyond its limit. */
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
    // The reset button is shown only after the camera was touched.
    if (camera.isTouched !== isTouched) this.#element.requestUpdate();
    return moves;
  }

  /** Sets the orbit target that a visitor picks, in viewer space. */
  aimAt(point: Vector3): void {
    this.#touched();
    this.camera.aimAt(point);
  }

  /**
   * Rotates or moves the camera in flight. A drag by the height of the frame rotates by the field of view, so that the
   * scene follows the pointer.
   */
  #flyWith(action: Extract<CameraAction, { type: 'orbit' | 'zoom' }>): void {
    const camera = this.camera;
    if (action.type === 'zoom') {
      const ahead = -Math.log(action.factor);
      if (this.#walks) return this.core.walk.value?.ahead(WHEEL_METERS * ahead);
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

/** Meters that a zoom by the factor e moves a walking camera. */
const WHEEL_METERS = 2;

/** Whether the frame has keyboard focus. Automatic motion is not allowed while it has. */
const hasKeyboard = (surface: HTMLElement | null): boolean => surface?.matches(':focus-visible') ?? false;
