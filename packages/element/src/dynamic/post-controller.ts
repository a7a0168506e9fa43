import type { Backend } from '../gpu/backend.js';
import { LatestTask } from '../latest-task.js';
import { PostView, type PostRequest } from './post-view.js';

export interface PostHost {
  /** Additional data of a request for a post-processor. */
  readonly postRequest: Omit<PostRequest, 'urls' | 'signal' | 'onChange'>;
  requestFrame(): void;
  /** Called when there is another filter, or none. */
  notifyInputs(): void;
}

/**
 * Inserts the post-processor of the attribute between the frames and the canvas. Until it is loaded, unprocessed frames
 * are shown.
 */
export class PostController {
  readonly #host: PostHost;
  readonly #opening = new LatestTask();

  constructor(host: PostHost) {
    this.#host = host;
  }

  /**
   * @param painter null while nothing is drawn.
   * @param urls In execution order; none for unprocessed frames.
   */
  open(backend: Backend | null, urls: readonly string[]): void {
    this.#opening.renew();
    if (backend === null) return;
    if (backend.filter) {
      this.#host.requestFrame();
      this.#host.notifyInputs();
    }
    backend.setFilter(undefined);
    if (urls.length === 0) return;
    const options = this.#host.postRequest;
    this.#opening.run((signal) => this.#load(backend, { ...options, urls, signal }), options.onError);
  }

  async #load(backend: Backend, request: Omit<PostRequest, 'onChange'>): Promise<void> {
    const { signal, onError } = request;
    const view = await PostView.open(
      {
        ...request,
        onError: (error) => (signal.aborted ? undefined : onError(error)),
        onChange: () => this.#host.requestFrame(),
      },
      backend.device,
    );
    if (signal.aborted || backend.isDestroyed) return view.close();
    backend.setFilter(view);
    this.#host.notifyInputs();
    this.#host.requestFrame();
  }
}
