import { loadModule } from '@gaussian-splat/core';
import type { Painter } from '../gpu/painter.js';
import { LatestTask } from '../latest-task.js';
import type { PostRequest } from './post-view.js';

export interface PostHost {
  /** What a post-processor needs to know beyond its address. */
  readonly postRequest: Omit<PostRequest, 'urls' | 'signal' | 'onChange'>;
  requestFrame(): void;
  /** There is another filter, or none. */
  tellInputs(): void;
}

/** Puts the post-processor of the attribute between the frames and the canvas. Until it is there, frames are shown as they are drawn. */
export class PostController {
  readonly #host: PostHost;
  #urls: readonly string[] = [];
  #painter: Painter | null = null;
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

  /** Frames are drawn, or none any more. A painter that is destroyed closes its processor itself. */
  attach(painter: Painter | null): void {
    this.#painter = painter;
    this.#open();
  }

  #open(): void {
    this.#opening.renew();
    const painter = this.#painter;
    if (painter === null) return;
    if (painter.filter) {
      this.#host.requestFrame();
      this.#host.tellInputs();
    }
    painter.setFilter(undefined);
    if (this.#urls.length === 0) return;
    const options = this.#host.postRequest;
    this.#opening.run((signal) => this.#load(painter, options, signal), options.onError);
  }

  async #load(painter: Painter, options: PostHost['postRequest'], signal: AbortSignal): Promise<void> {
    const { PostView } = await loadModule('the code that runs post-processors', () => import('./post-view.js'));
    if (signal.aborted) return;
    const view = await PostView.open(
      {
        ...options,
        urls: this.#urls,
        signal,
        onError: (error) => (signal.aborted ? undefined : options.onError(error)),
        onChange: () => this.#host.requestFrame(),
      },
      painter.device,
    );
    if (signal.aborted || painter.isDestroyed) return view.close();
    painter.setFilter(view);
    this.#host.tellInputs();
    this.#host.requestFrame();
  }
}
