import type { ReactiveControllerHost } from 'lit';
import type { Attributes } from './attributes.js';
import type { CameraAction } from './camera/gestures.js';
import { CameraController } from './controllers/camera-controller.js';
import { InputController, type InputOptions } from './controllers/input-controller.js';
import { SceneController } from './controllers/scene-controller.js';
import { SizeController } from './controllers/size-controller.js';
import { ViewController } from './controllers/view-controller.js';
import { VisibilityController } from './controllers/visibility-controller.js';
import type { GaussianSplatEventMap } from './events.js';
import type { FrameScheduler } from './gpu/frame-scheduler.js';
import type { SharedDevice } from './gpu/shared-device.js';
import type { SceneRequest } from './loading/protocol.js';
import type { SceneLoader } from './loading/scene-loader.js';

/** What elements share. */
export interface Services {
  readonly sharedDevice: SharedDevice;
  readonly sceneLoader: SceneLoader;
  readonly frameScheduler: FrameScheduler;
  /** How long a removed element keeps its scene, ms. */
  readonly releaseDelay: number;
}

/** What the stage asks its element for. */
export interface StageOptions {
  readonly attributes: () => Attributes;
  readonly input: () => InputOptions;
  readonly services: () => Services;
  /** Parts of the shadow tree, once they are rendered. */
  readonly canvas: () => HTMLCanvasElement | null;
  readonly surface: () => HTMLElement | null;
}

/**
 * All that goes on behind the element's attributes and markup: scene, camera, size, sight and input, and who of them
 * tells whom. Fires the element's events.
 */
export class Stage {
  readonly camera: CameraController;
  readonly scene: SceneController;
  /** Share of the bytes that have arrived, 0..1; null while their number is not known. */
  progress: number | null = null;
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #options: StageOptions;
  readonly #visibility: VisibilityController;
  readonly #size: SizeController;
  readonly #view: ViewController;
  #src: string | null = null;

  constructor(host: ReactiveControllerHost & HTMLElement, options: StageOptions) {
    this.#host = host;
    this.#options = options;
    this.camera = new CameraController(options.attributes().camera, () => this.#view.requestFrame());
    this.#visibility = new VisibilityController(host, () => this.#onVisibility());
    this.#size = new SizeController(host, options.canvas, () => this.#onSize());
    this.#view = this.#createView();
    this.scene = this.#createScene();
    new InputController(host, options.surface, options.input, (action) => this.#act(action));
    // Put back after a while, an eager element loads again though nothing has come into sight.
    host.addController({ hostConnected: () => this.#requestScene() });
  }

  /** The scene to show, as the `src` attribute has it. Called after every update; only changes act. */
  setSource(src: string | null): void {
    this.#src = src;
    this.#requestScene();
    // A changed attribute may concern the picture, for example its pixel ratio.
    this.#view.requestFrame();
  }

  #createView(): ViewController {
    const { services, attributes, canvas } = this.#options;
    return new ViewController({
      scheduler: () => services().frameScheduler,
      camera: this.camera,
      size: this.#size,
      canvasOf: canvas,
      isVisible: () => this.#visibility.isVisible,
      maxPixelRatio: () => attributes().maxPixelRatio,
      quality: () => attributes().quality,
      decayMs: () => (prefersReducedMotion() ? 0 : attributes().interpolationDecay),
      onCameraChange: (source) => this.#dispatch(new CustomEvent('camera-change', { detail: { source } })),
      onError: (error) => this.scene.fail(error),
    });
  }

  #createScene(): SceneController {
    const { services } = this.#options;
    return new SceneController(this.#host, {
      device: () => services().sharedDevice,
      loader: () => services().sceneLoader,
      releaseDelayMs: () => services().releaseDelay,
      show: (scene, isNew) => {
        if (isNew) this.camera.frame(scene.bounds);
        return this.#view.show(scene);
      },
      hide: (clear) => (clear ? this.#view.clear() : this.#view.pause()),
      onProgress: (loaded, total) => this.#onProgress(loaded, total),
      onLoad: (url) => this.#dispatch(new CustomEvent('load', { detail: { url } })),
      onError: (error) => this.#dispatch(new CustomEvent('error', { detail: error })),
      onContext: (type) => this.#dispatch(new Event(type)),
    });
  }

  #requestScene(): void {
    const { loading, credentials, quality } = this.#options.attributes();
    const sh = quality === 'reference' ? 'float16' : 'auto';
    const request: SceneRequest | null = this.#src ? { url: absoluteUrl(this.#src), credentials, sh } : null;
    if (this.#host.isConnected) this.scene.want(request, loading === 'eager' || this.#visibility.isVisible);
  }

  #onVisibility(): void {
    this.#requestScene();
    this.#view.requestFrame();
  }

  #onSize(): void {
    this.camera.setAspect(this.#size.aspect);
    this.#view.requestFrame();
  }

  #onProgress(loaded: number, total: number | undefined): void {
    this.progress = total ? Math.min(1, loaded / total) : null;
    this.#host.requestUpdate();
    const lengthComputable = total !== undefined;
    this.#dispatch(new ProgressEvent('progress', { lengthComputable, loaded, total: total ?? 0 }));
  }

  #act(action: CameraAction): void {
    const { camera } = this;
    if (action.type === 'orbit') camera.orbitBy(action.theta, action.phi);
    else if (action.type === 'zoom') camera.zoomBy(action.factor);
    else if (action.type === 'pan') camera.panBy(action.right, action.up);
    else camera.reset('user-interaction');
  }

  #dispatch(event: GaussianSplatEventMap[keyof GaussianSplatEventMap]): void {
    this.#host.dispatchEvent(event);
  }
}

/** The worker has a base URL of its own, so it is given whole ones. What is no URL stays as it is, and fails there. */
function absoluteUrl(src: string): string {
  return URL.canParse(src, document.baseURI) ? new URL(src, document.baseURI).href : src;
}

const prefersReducedMotion = (): boolean => matchMedia('(prefers-reduced-motion: reduce)').matches;
