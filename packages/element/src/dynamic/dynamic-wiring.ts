import { Lazy, type Camera } from '@gaussian-splat/core';
import { credentialsOf } from '../attributes.js';
import type { PlaybackController } from '../controllers/playback-controller.js';
import { toElementError } from '../errors.js';
import type { GaussianSplatEventMap } from '../events.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { ElementHost } from '../element-host.js';
import type { DynamicListeners, DynamicState } from './dynamic-model.js';
import type { Backend } from '../gpu/backend.js';
import type { PostHost } from './post-controller.js';

/** Interface of the element for its models. */
export interface DynamicHost extends Pick<ElementHost, 'attributes' | 'services' | 'dynamicValues'> {
  readonly playback: PlaybackController;
  /** The sources that are drawn. */
  readonly shown: readonly LoadedGaussians[];
  requestFrame(): void;
  readonly element: HTMLElement;
  dispatch(event: GaussianSplatEventMap[keyof GaussianSplatEventMap]): void;
}

/** Connects the models of an element, a generator and a post-processor, with its state and events. */
export class DynamicWiring implements PostHost {
  readonly #post = new Lazy('the code that runs post-processors', async () => {
    const { PostController } = await import('./post-controller.js');
    return new PostController(this);
  });
  #postUrls: readonly string[] = [];
  #backend: Backend | null = null;
  readonly #host: DynamicHost;
  #lastFault = '';
  /** Previous number of inputs. */
  #inputs = 0;

  constructor(host: DynamicHost) {
    this.#host = host;
  }

  /** Whether there is a post-processor, or will be. */
  get hasPost(): boolean {
    return this.#postUrls.length > 0;
  }

  /** @param urls Absolute addresses of post-processors, in execution order; none for unprocessed frames. */
  wantPost(urls: readonly string[]): void {
    if (urls.join(' ') === this.#postUrls.join(' ')) return;
    this.#postUrls = urls;
    this.#open();
  }

  /** Call when drawing starts or stops. A destroyed backend closes its post-processor itself. */
  attachPost(backend: Backend | null): void {
    this.#backend = backend;
    this.#open();
  }

  #open(): void {
    if (this.#post.value) this.#post.value.open(this.#backend, this.#postUrls);
    else if (this.hasPost && this.#backend)
      this.#post.get().then(
        (post) => post.open(this.#backend, this.#postUrls),
        (error: unknown) => this.#fail(error),
      );
  }

  get postRequest(): PostHost['postRequest'] {
    const { attributes, services, element } = this.#host;
    return {
      element,
      credentials: credentialsOf(attributes.crossorigin),
      runtimeLocation: services.runtimeLocation,
      loader: services.sceneLoader,
      limits: services.sceneLimits,
      state: () => this.state,
      others: () => this.#host.shown.flatMap(({ live }) => live?.settable ?? []),
      onError: (error) => this.#fail(error),
      onFallback: (reason) => this.#fallBack(reason),
    };
  }

  requestFrame(): void {
    this.#host.requestFrame();
  }

  /** Reports a change of inputs, after the change is shown. */
  notifyInputs(inputs: { readonly length: number } = [0]): void {
    if (inputs.length + this.#inputs > 0) queueMicrotask(() => this.#host.dispatch(new Event('inputs-change')));
    this.#inputs = inputs.length;
  }

  /** Current state of the models that the page sets. */
  get state(): DynamicState {
    return { ...this.#host.dynamicValues, timeSeconds: this.#host.playback.currentTime };
  }

  get listeners(): DynamicListeners {
    // The clock of a scene may change.
    const onShown = (timeSeconds: number): void => this.#host.playback.frameShown(timeSeconds);
    return {
      onFrame: (timeSeconds) => {
        this.#lastFault = '';
        this.requestFrame();
        onShown(timeSeconds);
      },
      onShown,
      onError: (error) => this.#fail(error),
      onFallback: (reason) => this.#fallBack(reason),
      onInput: () => this.requestFrame(),
    };
  }

  /**
   * Advances the clock of an animated scene before a frame, and requests its generator's output. The frame does not
   * wait.
   */
  advance({ live }: LoadedGaussians, camera: Camera, now: number): void {
    if (live === undefined) return;
    const { playback } = this.#host;
    playback.tick(now, live.loadedUntil?.(playback.currentTime));
    try {
      live.request(this.state, camera);
    } catch (error) {
      // Values of the page that do not match the model are reported once, not in each frame.
      this.#fail(error);
    }
  }

  #fail(cause: unknown): void {
    const error = toElementError(cause);
    // The loss of the device has its own events.
    if (error.code === 'device-lost' || error.message === this.#lastFault) return;
    this.#lastFault = error.message;
    this.#host.dispatch(new CustomEvent('generator-error', { detail: error }));
  }

  #fallBack(reason: string): void {
    this.#host.dispatch(new CustomEvent('generator-fallback', { detail: { reason } }));
  }
}
