import { loadModule } from '@gaussian-splat/core';
import { why } from '../gpu/request-device.js';
import type {
  FileRequest,
  LoadedScene,
  LoadedSequence,
  PartListener,
  PreviewListener,
  ProgressListener,
  SceneRequest,
  SentScene,
  WorkerRequest,
} from './protocol.js';
import type * as workerModule from './scene-worker.js';
import { WORKER_SOURCES } from './worker-sources.js';
import { spawnAt } from './spawn-worker.js';
import { WorkerPool } from './worker-pool.js';

/** The module of the worker's code. */
export type SceneWorker = typeof workerModule;

/**
 * Loads scenes in workers. One worker serves the whole page: it starts with the first load and ends when idle. More
 * workers are started only if it does not respond.
 */
export class SceneLoader {
  /** Starts a worker that the caller owns and must terminate. */
  readonly spawn: () => Worker;
  readonly #pool: WorkerPool;
  /** Index in {@link WORKER_SOURCES} of the current way to start a worker. */
  #way = 0;
  /** The directive of the page's Content-Security-Policy that has blocked a worker. */
  #violated: string | undefined;

  /**
   * @param spawn Starts a worker; default: the package's own. Tests pass another function.
   * @param locationOf Returns the address of the worker's script; null for the element's own.
   */
  constructor(spawn?: () => Worker, locationOf: () => string | null = () => null) {
    this.spawn = spawn ?? (() => this.#spawnAt(locationOf()));
    this.#pool = new WorkerPool(
      this.spawn,
      () => this.#code(),
      (reason) => void this.#warn(reason, locationOf()),
      () => !spawn && locationOf() === null && ++this.#way < WORKER_SOURCES.length,
    );
  }

  #spawnAt(location: string | null): Worker {
    document.addEventListener('securitypolicyviolation', this.#note);
    return location === null ? WORKER_SOURCES[this.#way]() : spawnAt(new URL(location, document.baseURI));
  }

  async #warn(reason: string, location: string | null): Promise<void> {
    try {
      const { warnOfRefusal } = await import('./refusal.js');
      warnOfRefusal(reason, this.#violated, location);
    } catch {
      console.warn(reason);
    }
  }

  readonly #note = ({ effectiveDirective }: SecurityPolicyViolationEvent): void => {
    if (effectiveDirective === 'worker-src') this.#violated = effectiveDirective;
  };

  /**
   * Fetches, reads and packs a scene. Rejects with GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or
   * with the signal's reason as soon as the signal is aborted.
   *
   * @param onPreview Called with previews of a large scene before it is complete; never after the promise has settled.
   */
  async load(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview?: PreviewListener,
  ): Promise<LoadedScene> {
    const loaded = await this.open(request, signal, onProgress, onPreview);
    if ('frames' in loaded) throw await why(({ sequenceWithin }) => sequenceWithin(request.url));
    return loaded;
  }

  /** Loads a scene as {@link load} does, or the manifest of a sequence, if the address names one. */
  open(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview?: PreviewListener,
  ): Promise<LoadedScene | LoadedSequence>;
  /**
   * Loads a scene or the manifest of a sequence, and may pass on the splats of a large scene as they are read.
   * @param onPart Receives the splats of a large scene before the promise resolves: see {@link SentScene}.
   */
  open(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview: PreviewListener | undefined,
    onPart: PartListener,
  ): Promise<LoadedScene | SentScene | LoadedSequence>;
  open(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview?: PreviewListener,
    onPart?: PartListener,
  ): Promise<LoadedScene | SentScene | LoadedSequence> {
    return this.ask(
      { type: 'load', request, wantsPreviews: onPreview !== undefined, wantsParts: onPart !== undefined },
      signal,
      ({ loadScene }) => loadScene(request, signal, { onProgress, onPreview }),
      { onProgress, onPreview, onPart },
    );
  }

  /**
   * Fetches the bytes of one file. Rejects with GaussianSplatError (`network/*`, `out-of-memory/*`), or with the
   * signal's reason as soon as the signal is aborted.
   */
  fetchFile(request: FileRequest, signal: AbortSignal): Promise<ArrayBuffer> {
    return this.ask({ type: 'file', request }, signal, ({ fetchFile }) => fetchFile(request, signal));
  }

  /**
   * Sends a request to a worker, and returns its answer: see `WorkerRequest`. Rejects as {@link load} does.
   * @param here Runs the request on the main thread, if workers are not available.
   */
  ask<T>(
    request: WorkerRequest,
    signal: AbortSignal,
    here: (code: SceneWorker) => Promise<T>,
    options?: Parameters<WorkerPool['run']>[3],
  ): Promise<T> {
    const run = (asked: WorkerRequest): Promise<T> =>
      this.#pool.run(asked, signal, async () => here(await this.#code()), options);
    return origin === 'null' ? withFile(request).then(run) : run(request);
  }

  async #code(): Promise<SceneWorker> {
    try {
      return await loadModule('the code that reads scenes', () => import('./scene-worker.js'));
    } catch (error) {
      // If the code cannot be loaded on the main thread either, the page's policy was not the cause, so workers are
      // tried again.
      this.#way = 0;
      this.#pool.retry();
      throw error;
    }
  }
}

/**
 * Adds the content of a `blob:` address to a request. Workers cannot read such addresses of pages without an origin,
 * which are opened from a disk or in a sandboxed frame.
 */
async function withFile(asked: WorkerRequest): Promise<WorkerRequest> {
  const { request } = asked as { readonly request?: Partial<FileRequest> };
  const url = request?.url;
  if (!url?.startsWith('blob:')) return asked;
  const file = await fetch(url).then(
    (response) => response.blob(),
    () => undefined,
  );
  return { ...asked, request: { ...request, file } } as WorkerRequest;
}
