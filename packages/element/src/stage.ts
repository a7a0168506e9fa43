import type { Camera } from '@gaussian-splat/core';
import type { ReactiveControllerHost } from 'lit';
import type { Attributes } from './attributes.js';
import type { CameraAction } from './camera/gestures.js';
import { CameraController } from './controllers/camera-controller.js';
import { PlaybackController } from './controllers/playback-controller.js';
import { InputController, type InputOptions } from './controllers/input-controller.js';
import { SceneController } from './controllers/scene-controller.js';
import { SizeController } from './controllers/size-controller.js';
import { ViewController } from './controllers/view-controller.js';
import { VisibilityController } from './controllers/visibility-controller.js';
import type { GaussianSplatEventMap } from './events.js';
import type { FrameScheduler } from './gpu/frame-scheduler.js';
import type { SharedDevice } from './gpu/shared-device.js';
import { toElementError } from './errors.js';
import type { GpuScene } from './gpu/gpu-scene.js';
import type { LiveListeners, LiveState } from './live/live-model.js';
import { PostController } from './live/post-controller.js';
import type { SceneRequest } from './loading/protocol.js';
import type { SceneLoader } from './loading/scene-loader.js';

/** What elements share. */
export interface Services {
  readonly sharedDevice: SharedDevice;
  readonly sceneLoader: SceneLoader;
  readonly frameScheduler: FrameScheduler;
  /** How long a removed element keeps its scene, ms. */
  readonly releaseDelay: number;
  /** Bytes of GPU memory that one scene may take; null for what suits the device. */
  readonly memoryBudget: number | null;
  /** Folder of ONNX Runtime's files; null for the one beside the bundle. */
  readonly runtimeLocation: string | null;
}

/** What is to be shown, as the element's attributes have it. */
export interface Source {
  readonly src: string | null;
  readonly contract: unknown;
  /** URLs with spaces between them. */
  readonly chain: string | null;
  readonly postprocess: string | null;
}

/** What the stage asks its element for. */
export interface StageOptions {
  readonly attributes: () => Attributes;
  readonly input: () => InputOptions;
  readonly services: () => Services;
  readonly loops: () => boolean;
  readonly liveValues: () => Omit<LiveState, 'timeSeconds'>;
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
  readonly playback: PlaybackController;
  /** Share of the bytes that have arrived, 0..1; null while their number is not known. */
  progress: number | null = null;
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #options: StageOptions;
  readonly #visibility: VisibilityController;
  readonly #size: SizeController;
  readonly #view: ViewController;
  readonly #post: PostController;
  #source: Source = { src: null, contract: null, chain: null, postprocess: null };
  #lastFault = '';

  constructor(host: ReactiveControllerHost & HTMLElement, options: StageOptions) {
    this.#host = host;
    this.#options = options;
    this.camera = new CameraController(options.attributes().camera, () => this.#view.requestFrame());
    this.#visibility = new VisibilityController(host, () => this.#onVisibility());
    this.#size = new SizeController(host, options.canvas, () => this.#onSize());
    this.playback = new PlaybackController({
      loops: options.loops,
      requestFrame: () => this.#view.requestFrame(),
      dispatch: (type) => this.#dispatch(new Event(type)),
    });
    this.#view = this.#createView();
    this.#post = this.#createPost();
    this.scene = this.#createScene();
    new InputController(host, options.surface, options.input, (action) => this.#act(action));
    // Put back after a while, an eager element loads again though nothing has come into sight.
    host.addController({ hostConnected: () => this.#requestScene() });
  }

  /** The scene to show. Called after every update; only changes act. */
  setSource(source: Source): void {
    this.#source = source;
    this.#post.want(absoluteUrls(source.postprocess));
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
      onFrame: (scene, camera, now) => this.#advance(scene, camera, now),
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
        this.playback.setDuration(scene.live?.duration ?? NaN);
        this.#post.attach(scene);
        return this.#view.show(scene);
      },
      hide: (clear) => {
        this.#post.attach(null);
        if (clear) this.playback.setDuration(NaN);
        if (clear) this.#view.clear();
        else this.#view.pause();
      },
      memoryBudget: () => services().memoryBudget ?? defaultMemoryBudget(),
      live: () => ({
        runtimeLocation: services().runtimeLocation,
        state: () => this.#liveState(),
        ownsControls: () => !this.#post.isWanted,
        camera: (bounds) => {
          if (bounds) this.camera.frame(bounds);
          return this.camera.view(...FIRST_SIZE);
        },
        listeners: this.#liveListeners(),
      }),
      onProgress: (loaded, total) => this.#onProgress(loaded, total),
      onLoad: (url) => this.#dispatch(new CustomEvent('load', { detail: { url } })),
      onError: (error) => this.#dispatch(new CustomEvent('error', { detail: error })),
      onContext: (type) => this.#dispatch(new Event(type)),
    });
  }

  #createPost(): PostController {
    return new PostController({
      requestFrame: () => this.#view.requestFrame(),
      request: () => ({
        credentials: this.#options.attributes().credentials,
        runtimeLocation: this.#options.services().runtimeLocation,
        state: () => this.#liveState(),
        onError: (error) => this.#onLiveError(error),
        onFallback: (reason) => this.#dispatch(new CustomEvent('generator-fallback', { detail: { reason } })),
      }),
    });
  }

  #requestScene(): void {
    const { loading, credentials, quality } = this.#options.attributes();
    const sh = quality === 'reference' ? 'float16' : 'auto';
    const { src, contract, chain } = this.#source;
    const request: SceneRequest | null = src
      ? { url: absoluteUrl(src), credentials, sh, contract, chain: absoluteUrls(chain) }
      : null;
    if (this.#host.isConnected) this.scene.want(request, loading === 'eager' || this.#visibility.isVisible);
  }

  #onVisibility(): void {
    this.#requestScene();
    if (!this.#visibility.isVisible) this.playback.suspend();
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

  #liveState(): LiveState {
    return { ...this.#options.liveValues(), timeSeconds: this.playback.currentTime };
  }

  /** Before a frame of a scene that moves: its clock goes on, and its generator hears of it. The frame does not wait. */
  #advance({ live }: GpuScene, camera: Camera, now: number): void {
    if (live === undefined) return;
    this.playback.tick(now);
    try {
      live.request(this.#liveState(), camera);
    } catch (error) {
      // Values of the page that do not fit the model: told once, not once a frame.
      this.#onLiveError(error);
    }
  }

  #liveListeners(): LiveListeners {
    return {
      onFrame: (timeSeconds) => {
        this.#lastFault = '';
        this.#view.requestFrame();
        this.playback.frameShown(timeSeconds);
      },
      onError: (error) => this.#onLiveError(error),
      onFallback: (reason) => this.#dispatch(new CustomEvent('generator-fallback', { detail: { reason } })),
      onInput: () => this.#view.requestFrame(),
    };
  }

  #onLiveError(cause: unknown): void {
    const error = toElementError(cause);
    // The loss of the device has events of its own.
    if (error.code === 'device-lost' || error.message === this.#lastFault) return;
    this.#lastFault = error.message;
    this.#dispatch(new CustomEvent('generator-error', { detail: error }));
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

/** Width and height, in pixels, that a generator hears of before the picture has a size: those of an element without style. */
const FIRST_SIZE = [300, 150] as const;

/** The worker has a base URL of its own, so it is given whole ones. What is no URL stays as it is, and fails there. */
function absoluteUrl(src: string): string {
  return URL.canParse(src, document.baseURI) ? new URL(src, document.baseURI).href : src;
}

const absoluteUrls = (urls: string | null): readonly string[] =>
  (urls ?? '').split(/\s+/).filter(Boolean).map(absoluteUrl);
/** The GPU's share of a device is known to nobody; half of the memory is what shared memory can spare. Browsers round it, and end at 8 GB or more. */
function defaultMemoryBudget(): number | undefined {
  const { deviceMemory } = navigator as { deviceMemory?: number };
  return deviceMemory === undefined ? undefined : deviceMemory * 2 ** 29;
}

const prefersReducedMotion = (): boolean => matchMedia('(prefers-reduced-motion: reduce)').matches;
