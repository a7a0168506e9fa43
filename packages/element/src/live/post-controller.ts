import { loadModule } from '@gaussian-splat/core';
import type { DrawnScene } from '../gpu/open-scene.js';
import { LatestTask } from '../latest-task.js';
import type { PostRequest } from './post-view.js';

export interface PostHost {
  /** What a post-processor needs to know beyond its address. */
  readonly postRequest: Omit<PostRequest, 'urls' | 'signal' | 'onChange' | 'others'>;
  requestFrame(): void;
}

/** Puts the post-processor of the attribute between the scene on show and the canvas. Until it is there, frames are shown as they are drawn. */
export class PostController {
  readonly #host: PostHost;
  #urls: readonly string[] = [];
  #scene: DrawnScene | null = null;
  readonly #opening = new LatestTask();

  constructor(host: PostHost) {
    this.#host = host;
  }

  /** True where there is one, or will be. */
  get isWanted(): boolean {
    return this.#urls.length > 0;
  }

  /** @param urls absolute addresses, in the order in which they run; none for frames as they are drawn */
  want(urls: readonly string[]): void {
    if (urls.join(' ') === this.#urls.join(' ')) return;
    this.#urls = urls;
    this.#open();
  }

  /** A scene is on show, or none any more. A scene that is destroyed closes its processor itself. */
  attach(scene: DrawnScene | null): void {
    this.#scene = scene;
    this.#open();
  }

  #open(): void {
    this.#opening.renew();
    const scene = this.#scene;
    if (scene === null) return;
    if (scene.filter) this.#host.requestFrame();
    scene.setFilter(undefined);
    if (this.#urls.length === 0) return;
    const options = this.#host.postRequest;
    this.#opening.run((signal) => this.#load(scene, options, signal), options.onError);
  }

  async #load(scene: DrawnScene, options: PostHost['postRequest'], signal: AbortSignal): Promise<void> {
    const { PostView } = await loadModule('the code that runs post-processors', () => import('./post-view.js'));
    if (signal.aborted) return;
    const view = await PostView.open(
      {
        ...options,
        urls: this.#urls,
        signal,
        others: () => scene.live?.settable ?? [],
        onError: (error) => (signal.aborted ? undefined : options.onError(error)),
        onChange: () => this.#host.requestFrame(),
      },
      scene.device,
    );
    if (signal.aborted || scene.isDestroyed) return view.close();
    scene.setFilter(view);
    this.#host.requestFrame();
  }
}
