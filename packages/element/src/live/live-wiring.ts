import { Lazy, type Camera } from '@gaussian-splat/core';
import { credentialsOf } from '../attributes.js';
import type { PlaybackController } from '../controllers/playback-controller.js';
import { toElementError } from '../errors.js';
import type { GaussianSplatEventMap } from '../events.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { StageHost } from '../stage-host.js';
import type { LiveListeners, LiveState } from './live-model.js';
import type { Painter } from '../gpu/painter.js';
import type { PostHost } from './post-controller.js';

/** Whom the models of an element meet. */
export interface LiveHost extends Pick<StageHost, 'attributes' | 'services' | 'liveValues'> {
  readonly playback: PlaybackController;
  /** The sources that are drawn. */
  readonly shown: readonly LoadedGaussians[];
  requestFrame(): void;
  readonly element: HTMLElement;
  dispatch(event: GaussianSplatEventMap[keyof GaussianSplatEventMap]): void;
}

/** What the models of an element, a generator and a post-processor, are told and whom they tell. */
export class LiveWiring implements PostHost {
  readonly #post = new Lazy('the code that runs post-processors', async () => {
    const { PostController } = await import('./post-controller.js');
    return new PostController(this);
  });
  #postUrls: readonly string[] = [];
  #painter: Painter | null = null;
  readonly #host: LiveHost;
  #lastFault = '';
  /** How many inputs there were last. */
  #inputs = 0;

  constructor(host: LiveHost) {
    this.#host = host;
  }

  /** True if there is a post-processor, or will be. */
  get hasPost(): boolean {
    return this.#postUrls.length > 0;
  }

  /** @param urls absolute addresses of post-processors, in the order in which they run; none for frames as they are drawn */
  wantPost(urls: readonly string[]): void {
    if (urls.join(' ') === this.#postUrls.join(' ')) return;
    this.#postUrls = urls;
    this.#open();
  }

  /** Frames are drawn, or none any more. A painter that is destroyed closes its processor itself. */
  attachPost(painter: Painter | null): void {
    this.#painter = painter;
    this.#open();
  }

  #open(): void {
    if (this.#post.value) this.#post.value.open(this.#painter, this.#postUrls);
    else if (this.hasPost && this.#painter)
      this.#post.get().then(
        (post) => post.open(this.#painter, this.#postUrls),
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

  /** What the page may set is another thing than before, once what is told of is on show. */
  tellInputs(inputs: { readonly length: number } = [0]): void {
    if (inputs.length + this.#inputs > 0) queueMicrotask(() => this.#host.dispatch(new Event('inputs-change')));
    this.#inputs = inputs.length;
  }

  /** What the page says about the models at this time. */
  get state(): LiveState {
    return { ...this.#host.liveValues, timeSeconds: this.#host.playback.currentTime };
  }

  get listeners(): LiveListeners {
    // Which clock a scene follows may change.
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

  /** Before a frame of a scene that moves: its clock goes on, and its generator hears of it. The frame does not wait. */
  advance({ live }: LoadedGaussians, camera: Camera, now: number): void {
    if (live === undefined) return;
    const { playback } = this.#host;
    playback.tick(now, live.isLacking?.(playback.currentTime));
    try {
      live.request(this.state, camera);
    } catch (error) {
      // Values of the page that do not fit the model: told once, not once a frame.
      this.#fail(error);
    }
  }

  #fail(cause: unknown): void {
    const error = toElementError(cause);
    // The loss of the device has events of its own.
    if (error.code === 'device-lost' || error.message === this.#lastFault) return;
    this.#lastFault = error.message;
    this.#host.dispatch(new CustomEvent('generator-error', { detail: error }));
  }

  #fallBack(reason: string): void {
    this.#host.dispatch(new CustomEvent('generator-fallback', { detail: { reason } }));
  }
}
