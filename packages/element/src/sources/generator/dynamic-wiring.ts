import { Lazy, type Camera } from '@gaussian-splat/core';
import { credentialsOf, type Attributes } from '../../viewer/attributes.js';
import type { PlaybackController } from '../../viewer/playback-controller.js';
import { toElementError } from '../../viewer/errors.js';
import type { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import type { Services } from '../../viewer/element-host.js';
import type { DynamicListeners, DynamicState } from './dynamic-model.js';
import type { Backend } from '../../gpu/backend.js';
import type { PostHost } from './post-controller.js';

/** Interface of the element for its models. */
export interface DynamicHost {
  readonly attributes: Attributes;
  readonly services: Services;
  /** `dynamicValues`: inputs that the page has set, besides the time. */
  readonly owner: { readonly dynamicValues: Omit<DynamicState, 'timeSeconds'> };
  readonly playback: PlaybackController;
  /** The loaded scenes that are drawn. */
  readonly shown: readonly LoadedGaussians[];
  requestFrame(): void;
  readonly element: HTMLElement;
  /** The scene of the entry: see {@link SceneController.renew}. */
  readonly scene: { renew(error: unknown): Promise<void> };
}

/** Connects the models of an element, which are generators and post-processors, with its state and its events. */
export class DynamicWiring implements PostHost {
  readonly #post = new Lazy('the code that runs post-processors', async () => {
    const { PostController } = await import('./post-controller.js');
    return new PostController(this);
  });
  #postUrls: readonly string[] = [];
  #backend: Backend | null = null;
  readonly #host: DynamicHost;
  #lastFault = '';
  /** Number of inputs at the last notification. */
  #inputs = 0;

  constructor(host: DynamicHost) {
    this.#host = host;
  }

  /** Whether the page has requested a post-processor, which may not be loaded yet. */
  get hasPost(): boolean {
    return this.#postUrls.length > 0;
  }

  /**
   * Sets the post-processors. May be called at any rate: only changes have an effect.
   * @param urls Absolute addresses of post-processors, in execution order; empty for unprocessed frames.
   */
  wantPost(urls: readonly string[]): void {
    if (urls.join(' ') === this.#postUrls.join(' ')) return;
    this.#postUrls = urls;
    this.#open();
  }

  /** Call when drawing starts with a backend, or stops (null). A destroyed backend closes its post-processor itself. */
  attachPost(backend: Backend | null): void {
    this.#backend = backend;
    this.#open();
  }

  #open(): void {
    // A failure of the next scene or post-processor is reported, also if the last one has failed in the same way.
    this.#lastFault = '';
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
      shown: () => this.#host.shown.flatMap(({ live }) => live ?? []),
      onError: (error) => this.#fail(error),
      onFallback: (reason) => this.#fallBack(reason),
    };
  }

  requestFrame(): void {
    this.#host.requestFrame();
  }

  /** Fires `inputs-change` after the current task, unless there are no inputs and there were none before. */
  notifyInputs(inputs: { readonly length: number } = [0]): void {
    if (inputs.length + this.#inputs > 0)
      queueMicrotask(() => this.#host.element.dispatchEvent(new Event('inputs-change')));
    this.#inputs = inputs.length;
  }

  /** Inputs that the page has set for the models, and the current time of playback. */
  get state(): DynamicState {
    return { ...this.#host.owner.dynamicValues, timeSeconds: this.#host.playback.currentTime };
  }

  get listeners(): DynamicListeners {
    // Read at each call, because the playback of the host may change.
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
      onReplaced: (error) => void this.#host.scene.renew(error).catch((reason: unknown) => this.#fail(reason)),
    };
  }

  /** Requests the Gaussians of an animated scene at the current time. The frame does not wait for them. */
  advance({ live }: LoadedGaussians, camera: Camera): void {
    if (live === undefined) return;
    try {
      live.request(this.state, camera);
    } catch (error) {
      // Values of the page that do not suit the model are reported once, not in each frame.
      this.#fail(error);
    }
  }

  #fail(cause: unknown): void {
    const error = toElementError(cause);
    // The loss of the device has events of its own.
    if (error.code === 'device-lost' || error.message === this.#lastFault) return;
    this.#lastFault = error.message;
    this.#host.element.dispatchEvent(new CustomEvent('generator-error', { detail: error }));
  }

  #fallBack(reason: string): void {
    this.#host.element.dispatchEvent(new CustomEvent('generator-fallback', { detail: { reason } }));
  }
}
