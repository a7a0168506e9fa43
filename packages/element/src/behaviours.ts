import type { Vector3 } from '@gaussian-splat/core';
import type { ReactiveControllerHost } from 'lit';
import type { Attributes } from './attributes.js';
import type { CameraAction } from './camera/gestures.js';
import { viewName } from './camera/spoken.js';
import type { SpokenStrings } from './words.js';
import { AnnouncerController } from './controllers/announcer-controller.js';
import { AutoRotateController } from './controllers/auto-rotate-controller.js';
import type { CameraController } from './controllers/camera-controller.js';
import { FlyController } from './controllers/fly-controller.js';
import { MotionController, type MotionOptions } from './controllers/motion-controller.js';
import { prefersReducedMotion, reducedMotion, type Mover } from './controllers/mover.js';
import { PromptController } from './controllers/prompt-controller.js';

/** What the behaviours ask of their element. */
export interface BehaviourOptions {
  readonly attributes: () => Attributes;
  readonly hasControls: () => boolean;
  readonly autoRotates: () => boolean;
  readonly autoplays: () => boolean;
  readonly playback: MotionOptions['playback'];
  readonly strings: () => SpokenStrings;
  /** The scene is on show, in sight, and no poster covers it. */
  readonly isOnShow: () => boolean;
  readonly surface: () => HTMLElement | null;
  readonly requestFrame: () => void;
}

/** All that happens around the camera besides a person's own hands: turning, prompting, flying, speaking. */
export class Behaviours {
  readonly prompt: PromptController;
  readonly announcer: AnnouncerController;
  readonly motion: MotionController;
  readonly #camera: CameraController;
  readonly #options: BehaviourOptions;
  readonly #autoRotate: AutoRotateController;
  readonly #movers: readonly Mover[];

  constructor(host: ReactiveControllerHost & HTMLElement, camera: CameraController, options: BehaviourOptions) {
    this.#camera = camera;
    this.#options = options;
    const { attributes, requestFrame, surface } = options;
    const turnBy = (theta: number): number => camera.turnBy(theta);
    this.motion = new MotionController(host, {
      ...options,
      rotates: options.autoRotates,
      prefersReducedMotion,
      startTurning: () => this.#autoRotate.start(),
    });
    const mayMove = (): boolean => options.isOnShow() && !prefersReducedMotion() && !this.motion.isHeld;
    this.#autoRotate = new AutoRotateController(host, {
      mayTurn: () => options.autoRotates() && mayMove() && !hasKeyboard(surface()),
      delayMs: () => attributes().autoRotateDelay,
      radiansPerSecond: () => attributes().rotationPerSecond,
      turnBy,
      requestFrame,
    });
    this.prompt = new PromptController(host, {
      mayShow: () => options.hasControls() && attributes().interactionPrompt === 'auto' && options.isOnShow(),
      thresholdMs: () => attributes().interactionPromptThreshold,
      wiggles: () => this.promptWiggles,
      turnBy,
      requestFrame,
    });
    const fly = new FlyController(host, {
      enabled: () => options.hasControls() && this.#flies,
      surface,
      scale: () => camera.bounds.radius,
      moveBy: (right, up, forward) => {
        this.#touched();
        camera.moveBy(right, up, forward);
      },
      requestFrame,
    });
    this.announcer = new AnnouncerController(host, {
      viewName: () => viewName(camera.orbit.theta, camera.orbit.phi),
      strings: options.strings,
      // In flight there is no side from which the scene is seen.
      isFocused: () => !this.#flies && (surface()?.matches(':focus') ?? false),
    });
    this.#movers = [this.#autoRotate, this.prompt, fly];
    let motion: MediaQueryList | undefined;
    const onMotion = (): void => host.requestUpdate();
    host.addController({
      hostUpdated: () => (camera.pivot = this.#flies ? 'eye' : 'target'),
      hostConnected: () => {
        // From the picture to the button inside counts, too.
        host.shadowRoot?.addEventListener('focusout', this.#onBlur);
        motion = reducedMotion();
        motion.addEventListener('change', onMotion);
      },
      hostDisconnected: () => {
        host.shadowRoot?.removeEventListener('focusout', this.#onBlur);
        motion?.removeEventListener('change', onMotion);
      },
    });
  }

  /** The camera moves to and fro with the prompt: only for people who have not asked for less motion. */
  get promptWiggles(): boolean {
    return this.#options.attributes().interactionPromptStyle === 'wiggle' && !prefersReducedMotion();
  }

  get #flies(): boolean {
    return this.#options.attributes().navigation === 'fly';
  }

  /** Moves what moves by itself on to a frame. */
  advance(now: number): void {
    for (const mover of this.#movers) if (mover.advance(now)) this.#options.requestFrame();
  }

  /** A person's gesture or key. */
  act(action: CameraAction): void {
    const camera = this.#camera;
    this.#touched();
    if (action.type === 'reset') camera.reset('user-interaction');
    else if (action.type === 'pan') camera.panBy(action.right, action.up);
    else if (this.#flies) this.#fly(action);
    else if (action.type === 'orbit') camera.orbitBy(action.theta, action.phi);
    else camera.zoomBy(action.factor);
  }

  /** A person picks another point to turn around: viewer space. */
  aimAt(point: Vector3): void {
    this.#touched();
    this.#camera.aimAt(point);
  }

  /** In flight the scene follows the pointer: a drag across the picture turns the view by the picture's own angle. */
  #fly(action: Extract<CameraAction, { type: 'orbit' | 'zoom' }>): void {
    const camera = this.#camera;
    if (action.type === 'zoom') return camera.moveBy(0, 0, -Math.log(action.factor) * camera.bounds.radius);
    const share = camera.fieldOfView.radians / (2 * Math.PI);
    camera.lookBy(-share * action.theta, -share * action.phi);
  }

  #touched(): void {
    this.prompt.dismiss();
    this.#autoRotate.rest();
  }

  readonly #onBlur = (): void => this.#autoRotate.rest();
}

/** True while a person has come to the picture by keyboard, and nothing may move under their hands. */
const hasKeyboard = (surface: HTMLElement | null): boolean => surface?.matches(':focus-visible') ?? false;
