import type { Backend } from '../../gpu/backend.js';
import { LatestTask } from '../../viewer/latest-task.js';
import { PostView, type PostRequest } from './post-view.js';

export interface PostHost {
  /** Parameters of the element for opening a post-processor. */
  readonly postRequest: Omit<PostRequest, 'urls' | 'signal' | 'onChange'>;
  requestFrame(): void;
  /** Called when the post-processor has been set or removed, so that the inputs may have changed. */
  notifyInputs(): void;
}

/**
 * Inserts the post-processors of the attribute `postprocess` between the renderer and the canvas. Until they are
 * loaded, unprocessed frames are shown.
 */
export class PostController {
  readonly #host: PostHost;
  readonly #opening = new LatestTask();
  /** Backend and addresses that are open, are being opened, or have failed. */
  #backend: Backend | null = null;
  #urls = '';

  constructor(host: PostHost) {
    this.#host = host;
  }

  /**
   * Opens post-processors for a backend, instead of the previous ones. May be called at any rate, as for each child that
   * is shown: only changes have an effect.
   * @param backend Backend that draws the frames; null while nothing is drawn.
   * @param urls Absolute addresses in execution order; empty for unprocessed frames.
   */
  open(backend: Backend | null, urls: readonly string[]): void {
    const key = urls.join(' ');
    if (backend === this.#backend && key === this.#urls) return;
    [this.#backend, this.#urls] = [backend, key];
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
